"""Planar graph → boundary curves: every border fitted once, shared by its two regions (paper, section 4.2).

Arcs are cut at real corners, so that every curve is smooth; the cut points become nodes beside the junctions.
A curve runs from node to node, or is a closed periodic spline where a border meets no node.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcvec import bspline
from gcvec.planar_graph import OUTSIDE, Arc, PlanarGraph

Floats = NDArray[np.float64]

DISTANCE = 0.5
"""Largest distance of a curve from the mid-points of the cracks it follows, pixels."""

SEGMENT_LENGTH = 24.0
"""No segment of a curve is longer than this, pixels: the colours along it share its knots."""

CORNER_WINDOW = 5
CORNER_ANGLE = np.deg2rad(55.0)
"""An arc turns a corner where the chords over the window before and after a sample meet at this angle or more."""


@dataclass(frozen=True)
class Curve:
    """One cubic B-spline with uniform knots between the regions `left` and `right` (-1: outside the image).

    `control_points` is `(k, 2) float64`, pixels; the first and last are the positions of the nodes `start`
    and `end` (-1 each for a closed, periodic curve). The parameter polygons of both regions stay within 2^-`level` pixels of
    the curve.
    """

    control_points: Floats
    left: int
    right: int
    start: int
    end: int
    level: int = 0

    @property
    def closed(self) -> bool:
        return self.start < 0

    @property
    def segments(self) -> int:
        return bspline.segments_of(self.control_points, self.closed)

    @property
    def on_frame(self) -> bool:
        return self.left == OUTSIDE or self.right == OUTSIDE


Loop = tuple[tuple[int, bool], ...]
"""A closed walk over curves, `(curve, forward)`, with the region at the right hand."""


@dataclass(frozen=True)
class Network:
    """All boundary curves of a picture. `loops[r]` bounds region r; `n_nodes` counts junctions and corners."""

    width: int
    height: int
    n_nodes: int
    curves: tuple[Curve, ...]
    loops: tuple[tuple[Loop, ...], ...]


def boundary_network(
    graph: PlanarGraph, width: int, height: int, distances: Mapping[int, float] | None = None
) -> Network:
    """Fit the borders of a planar graph with B-splines.

    `distances` overrides the distance allowed to single curves, by number; at 0 the curve's control polygon is the border.
    """
    distances = distances or {}
    nodes = [(float(x), float(y)) for x, y in graph.nodes]
    curves: list[Curve] = []
    pieces_of: list[list[int]] = []
    for arc in graph.arcs:
        ends, runs = _cut_at_corners(arc, nodes)
        pieces_of.append([])
        for (start, end), samples in zip(ends, runs, strict=True):
            pieces_of[-1].append(len(curves))
            distance = distances.get(len(curves), DISTANCE)
            control = _fit_border(samples, start < 0, OUTSIDE in (arc.left, arc.right), distance)
            curves.append(Curve(control, arc.left, arc.right, start, end))
    loops = tuple(
        tuple(
            tuple(
                (c, forward) for a, forward in loop for c in (pieces_of[a] if forward else pieces_of[a][::-1])
            )
            for loop in region
        )
        for region in graph.loops
    )
    return Network(width, height, len(nodes), tuple(curves), loops)


def _fit_border(samples: Floats, closed: bool, on_frame: bool, distance: float) -> Floats:
    length = float(np.hypot(*np.diff(samples, axis=0).T).sum())
    segments = max(1, int(np.ceil(length / SEGMENT_LENGTH)))
    if on_frame:
        return straight_line(samples[0], samples[-1], segments)
    if distance == 0:
        return _padded(samples[:-1], 3) if closed else _padded(samples, 4)
    return bspline.fit_within(samples, distance, segments, closed)


def _padded(points: Floats, fewest: int) -> Floats:
    """The points, with mid-points put in until there are enough to be control points."""
    while len(points) < fewest:
        points = np.insert(points, 1, (points[0] + points[1]) / 2, axis=0)
    return points


def straight_line(a: Floats, b: Floats, segments: int) -> Floats:
    """Control points of the straight line from `a` to `b`, at uniform speed (Greville abscissae)."""
    knots = np.clip(np.arange(segments + 7) - 3, 0, segments)
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / (3 * segments)
    return np.asarray(a + greville[:, None] * (np.asarray(b) - a))


def _cut_at_corners(arc: Arc, nodes: list[tuple[float, float]]) -> tuple[list[tuple[int, int]], list[Floats]]:
    """Node pairs and sample runs of the smooth pieces of an arc; new corner nodes are appended to `nodes`."""
    lattice = arc.points.astype(np.float64)
    middles = (lattice[1:] + lattice[:-1]) / 2
    on_frame = OUTSIDE in (arc.left, arc.right)
    corners = [] if on_frame else list(_corners(middles, arc.closed, CORNER_WINDOW, CORNER_ANGLE))
    if arc.closed and not corners:
        return [(-1, -1)], [np.vstack([middles, middles[:1]])]
    # A corner after the k-th crack is the lattice point k + 1.
    if arc.closed:
        first = corners[0] + 1
        lattice = np.vstack([lattice[first:-1], lattice[: first + 1]])
        middles = np.vstack([middles[first:], middles[:first]])
        cuts = [k + 1 - first for k in corners[1:]]
        nodes.append((float(lattice[0, 0]), float(lattice[0, 1])))
        node, last = len(nodes) - 1, len(nodes) - 1
    else:
        cuts = [k + 1 for k in corners]
        node, last = arc.start, arc.end
    ends, runs = [], []
    begin = 0
    for cut in [*cuts, len(middles)]:
        if cut == len(middles):
            after = last
        else:
            nodes.append((float(lattice[cut, 0]), float(lattice[cut, 1])))
            after = len(nodes) - 1
        ends.append((node, after))
        runs.append(np.vstack([lattice[begin], middles[begin:cut], lattice[cut]]))
        begin, node = cut, after
    return ends, runs


@njit(cache=True, nogil=True)
def _corners(middles, closed, window, angle):
    """Indices of cracks at whose far end the border turns a corner: the sharpest within a window."""
    n = len(middles)
    turn = np.zeros(n)
    for i in range(n):
        before, after = i - window, i + 1 + window
        if closed:
            if n < 4 * window:
                continue
        elif before < 0 or after >= n:
            continue
        a, b = middles[before % n], middles[i]
        c, d = middles[(i + 1) % n], middles[after % n]
        ux, uy, vx, vy = b[0] - a[0], b[1] - a[1], d[0] - c[0], d[1] - c[1]
        turn[i] = abs(np.arctan2(ux * vy - uy * vx, ux * vx + uy * vy))
    found = np.empty(n, np.int64)
    count = 0
    for i in range(n):
        if turn[i] < angle:
            continue
        sharpest = True
        for k in range(-window, window + 1):
            j = (i + k) % n if closed else min(max(i + k, 0), n - 1)
            if turn[j] > turn[i] or (turn[j] == turn[i] and j < i):
                sharpest = False
        if sharpest:
            found[count] = i
            count += 1
    return found[:count]
