"""Coons patches of single regions, written out as the formulas read: what the examples compare.

A region is given by its boundary curves C_1, …, C_n: functions from [0, 1] to the plane, each beginning where
the one before ends.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from gcvec.patches.harmonic import harmonic_coordinates
from gcvec.patches.triangulation import constrained_delaunay

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Curve = Callable[[Floats], Floats]


@dataclass(frozen=True)
class Patch:
    """A domain's mesh, vertices `(v, 2)` and triangles `(t, 3)`, and the `image` `(v, 2)` of its vertices."""

    domain: Floats
    image: Floats
    triangles: Ints

    @property
    def flipped(self) -> NDArray[np.bool_]:
        """`(t,)`: the triangles whose orientation the patch reverses: there it folds over."""
        return np.asarray(_areas(self.domain, self.triangles) * _areas(self.image, self.triangles) <= 0)


def _areas(vertices: Floats, triangles: Ints) -> Floats:
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return np.asarray((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])


def line(a: Sequence[float], b: Sequence[float]) -> Curve:
    """The straight curve from a to b."""
    start, end = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return lambda t: start + t[:, None] * (end - start)


def bow(a: Sequence[float], b: Sequence[float], bulge: float) -> Curve:
    """A curve from a to b that swings out by `bulge` chord lengths, to the right hand for positive ones."""
    start, end = np.asarray(a, np.float64), np.asarray(b, np.float64)
    normal = np.array([start[1] - end[1], end[0] - start[0]])
    return lambda t: start + t[:, None] * (end - start) + (4 * bulge * t * (1 - t))[:, None] * normal


def polyline(points: Floats) -> Curve:
    """The curve through `points` `(n, 2)` at uniform speed."""
    length = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    length /= length[-1]
    return lambda t: np.stack(
        [np.interp(t, length, points[:, 0]), np.interp(t, length, points[:, 1])], axis=1
    )


def corners(curves: Sequence[Curve]) -> Floats:
    """p_1, …, p_n."""
    return np.concatenate([curve(np.zeros(1)) for curve in curves])


def regular_polygon(n: int) -> Floats:
    """Vertices `(n, 2)` on the unit circle."""
    angle = 2 * np.pi * np.arange(n) / n
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def classical_coons(curves: Sequence[Curve], n: int = 20) -> Patch:
    """The Coons patch of four curves over the unit square, on an n x n grid (Coons 1967)."""
    south, east, north, west = curves
    s = np.linspace(0, 1, n + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(s, s))
    p = corners(curves)
    u1, v1 = u[:, None], v[:, None]
    ruled = (1 - v1) * south(u) + v1 * north(1 - u) + (1 - u1) * west(1 - v) + u1 * east(v)
    bilinear = (1 - v1) * ((1 - u1) * p[0] + u1 * p[1]) + v1 * ((1 - u1) * p[3] + u1 * p[2])
    a = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = np.concatenate(
        [np.stack([a, a + 1, a + n + 2], axis=1), np.stack([a, a + n + 2, a + n + 1], axis=1)]
    )
    return Patch(np.stack([u, v], axis=1), ruled - bilinear, triangles)


def generalized_coons(polygon: Floats, curves: Sequence[Curve], fineness: int = 24) -> Patch:
    """The generalized Coons patch, equation (1), over a simple polygon Φ `(n, 2)`, with harmonic coordinates.

    The mesh has about `fineness` vertices across.
    """
    vertices, triangles, on_edge, along = _meshed(polygon, fineness)
    n = len(polygon)
    edges = np.stack([np.arange(n), (np.arange(n) + 1) % n], axis=1)
    coordinates = harmonic_coordinates(vertices, triangles, edges, on_edge, along, np.zeros(0, np.int64))
    image = -coordinates @ corners(curves)
    for i, curve in enumerate(curves):
        a, b = coordinates[:, i], coordinates[:, (i + 1) % n]
        both = a + b
        t = np.divide(b, both, out=np.zeros_like(b), where=both > 1e-12)
        image += both[:, None] * curve(t)
    return Patch(vertices, image, triangles)


def _meshed(polygon: Floats, fineness: int) -> tuple[Floats, Ints, Ints, Floats]:
    """Vertices, those of the polygon first; triangles; the edge a vertex is on (-1: none), how far along."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    step = float((high - low).max()) / fineness
    ends = np.roll(polygon, -1, axis=0)
    boundary, on_edge, along = [polygon], [np.arange(len(polygon))], [np.zeros(len(polygon))]
    rings = []
    count = len(polygon)
    for k, (a, b) in enumerate(zip(polygon, ends, strict=True)):
        pieces = max(int(np.ceil(np.hypot(*(b - a)) / step)), 2)
        t = np.arange(1, pieces) / pieces
        boundary.append(a + t[:, None] * (b - a))
        on_edge.append(np.full(len(t), k))
        along.append(t)
        rings.append(np.concatenate([[k], np.arange(count, count + len(t))]))
        count += len(t)
    ring = np.concatenate(rings)
    segments = np.stack([ring, np.roll(ring, -1)], axis=1)
    rows = np.arange(low[1] + step / 2, high[1], step * np.sqrt(3) / 2)
    columns = np.arange(low[0], high[0], step)
    inside = [
        np.stack([columns + (k % 2) * step / 2, np.full(len(columns), y)], axis=1) for k, y in enumerate(rows)
    ]
    grid = np.concatenate(inside)
    keep = shapely.contains_xy(shapely.Polygon(polygon).buffer(-0.4 * step), grid[:, 0], grid[:, 1])
    grid = grid[keep]
    vertices = np.concatenate([*boundary, grid])
    on_edge.append(np.full(len(grid), -1))
    along.append(np.zeros(len(grid)))
    triangles, _ = constrained_delaunay(vertices, segments)
    return vertices, triangles, np.concatenate(on_edge), np.concatenate(along)
