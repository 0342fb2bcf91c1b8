"""Label map → planar graph: nodes, and arcs that two regions share (paper, end of section 4.2).

The graph lives on the lattice of pixel corners. A *crack* is a lattice edge between two pixels of different
labels; everything outside the image carries the label -1. A lattice point is a *node* when three or more
cracks meet in it (three labels, a diagonal crossing, a border reaching the frame) or when it is a corner of
the image. An *arc* runs along cracks from node to node, or closes on itself, and is stored once.

Sides are as seen on the screen (x to the right, y down): whoever walks along an arc has `right` at the right
hand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

OUTSIDE = -1

# Steps along the lattice: east, south, west, north.
_DX = np.array([1, 0, -1, 0])
_DY = np.array([0, 1, 0, -1])


@dataclass(frozen=True)
class Arc:
    """A border between two regions.

    `points` is `(n, 2) int32`, the lattice points in walking order, both ends included (a closed arc repeats
    its first point). `start` and `end` are node indices, -1 for a closed arc that meets no node.
    """

    points: NDArray[np.int32]
    left: int
    right: int
    start: int
    end: int

    @property
    def closed(self) -> bool:
        return self.start < 0


@dataclass(frozen=True)
class PlanarGraph:
    """`nodes` is `(k, 2) int32` lattice points; `loops[r]` the boundary of region r.

    A loop is a tuple of `(arc, forward)`; walking it keeps the region at the right hand, so the outer
    loop has positive area in image coordinates and holes have negative area.
    """

    nodes: NDArray[np.int32]
    arcs: tuple[Arc, ...]
    loops: tuple[tuple[tuple[tuple[int, bool], ...], ...], ...]


@njit(cache=True, nogil=True)
def _cracks(padded):
    """`(h+1, w+1, 4) bool`: does a crack leave this lattice point to the east, south, west, north?"""
    height, width = padded.shape[0] - 1, padded.shape[1] - 1
    cracks = np.zeros((height, width, 4), np.bool_)
    for y in range(height):
        for x in range(width):
            north_west, north_east = padded[y, x], padded[y, x + 1]
            south_west, south_east = padded[y + 1, x], padded[y + 1, x + 1]
            cracks[y, x, 0] = north_east != south_east
            cracks[y, x, 1] = south_west != south_east
            cracks[y, x, 2] = north_west != south_west
            cracks[y, x, 3] = north_west != north_east
    return cracks


@njit(cache=True, nogil=True)
def _trace(cracks, node_at):
    """Walk every crack once.

    Returns the visited lattice points one arc after another, the arcs' first indices in them, and each arc's
    first direction.
    """
    height, width = node_at.shape
    todo = cracks.copy()
    total = 0
    for y in range(height):
        for x in range(width):
            for d in range(4):
                total += cracks[y, x, d]
    points = np.empty((total + 1, 2), np.int32)
    offsets = np.empty(total // 2 + 2, np.int64)
    n_points, n_arcs = 0, 0
    for closed_pass in range(2):
        for y0 in range(height):
            for x0 in range(width):
                if closed_pass == 0 and node_at[y0, x0] < 0:
                    continue
                for d0 in range(4):
                    if not todo[y0, x0, d0]:
                        continue
                    offsets[n_arcs] = n_points
                    n_arcs += 1
                    x, y, d = x0, y0, d0
                    points[n_points, 0], points[n_points, 1] = x, y
                    n_points += 1
                    while True:
                        todo[y, x, d] = False
                        x += _DX[d]
                        y += _DY[d]
                        todo[y, x, (d + 2) % 4] = False
                        if n_points == len(points):
                            grown = np.empty((2 * len(points), 2), np.int32)
                            grown[:n_points] = points
                            points = grown
                        points[n_points, 0], points[n_points, 1] = x, y
                        n_points += 1
                        if node_at[y, x] >= 0 or (x == x0 and y == y0):
                            break
                        for turn in range(4):
                            if turn != (d + 2) % 4 and cracks[y, x, turn]:
                                d = turn
                                break
    offsets[n_arcs] = n_points
    return points[:n_points], offsets[: n_arcs + 1]


def planar_graph(labels: NDArray[np.int32]) -> PlanarGraph:
    """Graph of the borders of a label map.

    `labels` is `(h, w) int32` with regions numbered 0..n-1, each 4-connected.
    """
    height, width = labels.shape
    padded = np.pad(labels, 1, constant_values=OUTSIDE)
    cracks = _cracks(padded)
    is_node = cracks.sum(axis=2) >= 3
    is_node[[0, 0, height, height], [0, width, 0, width]] = True
    node_at = np.full(is_node.shape, -1, np.int32)
    ys, xs = np.nonzero(is_node)
    node_at[ys, xs] = np.arange(len(ys))
    points, offsets = _trace(cracks, node_at)
    arcs = tuple(_arc(points[a:b], padded, node_at) for a, b in zip(offsets[:-1], offsets[1:], strict=True))
    nodes = np.stack([xs, ys], axis=1).astype(np.int32)
    return PlanarGraph(nodes, arcs, _loops(arcs, int(labels.max()) + 1))


def _arc(points: NDArray[np.int32], padded: NDArray[np.int32], node_at: NDArray[np.int32]) -> Arc:
    (x, y), (x1, y1) = points[0], points[1]
    # Quadrants around the first lattice point, in the padded map: [y, x] is its north-west pixel.
    step = (int(x1 - x), int(y1 - y))
    left, right = {
        (1, 0): (padded[y, x + 1], padded[y + 1, x + 1]),
        (0, 1): (padded[y + 1, x + 1], padded[y + 1, x]),
        (-1, 0): (padded[y + 1, x], padded[y, x]),
        (0, -1): (padded[y, x], padded[y, x + 1]),
    }[step]
    last = points[-1]
    return Arc(points, int(left), int(right), int(node_at[y, x]), int(node_at[last[1], last[0]]))


def _direction(a: NDArray[np.int32], b: NDArray[np.int32]) -> int:
    step = (int(b[0] - a[0]), int(b[1] - a[1]))
    return {(1, 0): 0, (0, 1): 1, (-1, 0): 2, (0, -1): 3}[step]


def _loops(arcs: tuple[Arc, ...], n_regions: int) -> tuple[tuple[tuple[tuple[int, bool], ...], ...], ...]:
    """Boundary loops of every region.

    Where a region touches itself at a diagonal crossing, the walk stays at the same pixel, because regions
    are
    4-connected: the quadrant at the right hand of the arriving step is that of the leaving one.
    """
    leaving: dict[tuple[int, int], list[tuple[int, tuple[int, bool]]]] = {}
    arriving: dict[tuple[int, bool], int] = {}
    half_edges: list[tuple[int, tuple[int, bool]]] = []
    for i, arc in enumerate(arcs):
        for forward, region, node in ((True, arc.right, arc.start), (False, arc.left, arc.end)):
            if region == OUTSIDE:
                continue
            p = arc.points if forward else arc.points[::-1]
            half = (i, forward)
            half_edges.append((region, half))
            if not arc.closed:
                leaving.setdefault((node, region), []).append((_direction(p[0], p[1]), half))
                arriving[half] = _direction(p[-2], p[-1])

    loops: list[list[tuple[tuple[int, bool], ...]]] = [[] for _ in range(n_regions)]
    done: set[tuple[int, bool]] = set()
    for region, first in half_edges:
        if first in done:
            continue
        loop, half = [], first
        while half not in done:
            done.add(half)
            loop.append(half)
            arc = arcs[half[0]]
            if arc.closed:
                break
            candidates = leaving[(arc.end if half[1] else arc.start, region)]
            if len(candidates) == 1:
                half = candidates[0][1]
            else:
                # Right of an eastward arrival lies the south-west quadrant, which is right of a southward
                # leave.
                turn = (arriving[half] + 1) % 4
                half = next(h for d, h in candidates if d == turn)
        loops[region].append(tuple(loop))
    return tuple(tuple(region_loops) for region_loops in loops)
