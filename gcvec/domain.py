"""Boundary curves → parameter polygons Φ that hug their regions (paper, section 4.1).

The vertices of all polygons lie on the curves, at boundary samples: junctions, corners, and as many further
samples as the polygons need to stay within a tolerance of the curves and clear of each other. Neighbours
share them, so the polygons of all regions tile the image. Each polygon edge belongs to one stretch of one
curve, C_i.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import shapely
from numba import njit
from numpy.typing import NDArray

from gcvec.boundary import Curve, Network

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FINEST_LEVEL = 8


def polygon_vertices(curve: Curve) -> Ints:
    """Which of a curve's samples are vertices of the polygons.

    Douglas-Peucker to the tolerance of the curve's level; a closed curve has at least three edges.
    """
    return np.flatnonzero(_douglas_peucker(curve.sampling.points, 3 if curve.closed else 1, 0.5**curve.level))


def without_crossings(network: Network) -> Network:
    """The network with levels raised until no polygon edges cross; curves must not cross themselves or
    others."""
    while True:
        bad = [c for c in crossing_curves(network) if network.curves[c].level < FINEST_LEVEL]
        if not bad:
            return network
        network = raise_levels(network, bad)


def with_levels(network: Network, level: int) -> Network:
    """The network with all parameter polygons at one level."""
    return replace(network, curves=tuple(c.at_level(level) for c in network.curves))


def raise_levels(network: Network, which: Iterable[int]) -> Network:
    """The network with the polygons twice as close to these curves."""
    curves = list(network.curves)
    for c in which:
        curves[c] = curves[c].at_level(min(curves[c].level + 1, FINEST_LEVEL))
    return replace(network, curves=tuple(curves))


@njit(cache=True, nogil=True)
def _chord_distance(points, a, b, p):
    """Distance of `points[p]` from the segment between `points[a]` and `points[b]`."""
    dx, dy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    px, py = points[p, 0] - points[a, 0], points[p, 1] - points[a, 1]
    square = dx * dx + dy * dy
    t = min(max((px * dx + py * dy) / square, 0.0), 1.0) if square > 0 else 0.0
    return np.hypot(px - t * dx, py - t * dy)


@njit(cache=True, nogil=True)
def _douglas_peucker(points, fewest, tolerance):
    last = len(points) - 1
    kept = np.zeros(last + 1, np.bool_)
    stack = np.empty((last + 1, 2), np.int64)
    top = 0
    for i in range(fewest):
        a, b = (i * last) // fewest, ((i + 1) * last) // fewest
        kept[a] = kept[b] = True
        stack[top, 0], stack[top, 1] = a, b
        top += 1
    while top > 0:
        top -= 1
        a, b = stack[top, 0], stack[top, 1]
        worst, where = tolerance, -1
        for p in range(a + 1, b):
            distance = _chord_distance(points, a, b, p)
            if distance > worst:
                worst, where = distance, p
        if where >= 0:
            kept[where] = True
            stack[top, 0], stack[top, 1] = a, where
            stack[top + 1, 0], stack[top + 1, 1] = where, b
            top += 2
    return kept


def polygon_edges(curve: Curve) -> Floats:
    """Parameter polygon edges along a curve, `(e, 2, 2) float64`."""
    vertices = curve.sampling.points[polygon_vertices(curve)]
    return np.stack([vertices[:-1], vertices[1:]], axis=1)


def crossing_curves(network: Network) -> Ints:
    """Curves with a polygon edge that meets another edge anywhere but in a common vertex."""
    edges = [polygon_edges(c) for c in network.curves]
    owner = np.repeat(np.arange(len(edges)), [len(e) for e in edges])
    flat = np.concatenate(edges)
    degenerate = (flat[:, 0] == flat[:, 1]).all(axis=1)
    lines = shapely.linestrings(flat)
    a, b = shapely.STRtree(lines).query(lines, predicate="intersects")
    a, b = a[a < b], b[a < b]
    n_shared = (flat[a][:, :, None] == flat[b][:, None, :]).all(axis=-1).sum(axis=(1, 2))
    # Two edges with one common end may still overlap: then their intersection is longer than a point.
    legal = (n_shared == 1) & (shapely.length(shapely.intersection(lines[a], lines[b])) == 0)
    return np.unique(np.concatenate([owner[a[~legal]], owner[b[~legal]], owner[degenerate]]))
