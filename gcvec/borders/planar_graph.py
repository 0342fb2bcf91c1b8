"""Label map → planar graph: nodes, and arcs that two regions share (paper, end of section 4.2).

The graph lives on the lattice of pixel corners. A *crack* is a lattice edge between two pixels of different
labels; everything outside the image carries the label -1. A lattice point is a *node* when three or more
cracks meet in it (three labels, a diagonal crossing, a border reaching the frame) or when it is a corner of
the image. An *arc* runs along cracks from node to node, or closes on itself, and is stored once.

Sides are as seen on the screen (x to the right, y down): whoever walks along an arc has `right` at the right
hand.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel

OUTSIDE = -1
"""The region of everything beyond the picture."""

MOST_AT_NODE = 8
"""Ends of curves that may meet in one node: four where pixels do, and six where two such nodes become one."""

Half = tuple[int, bool]
"""An arc (later a curve), by its number, as one of its two regions has it: whether it walks forward there."""

Loop = tuple[Half, ...]
"""A closed walk over arcs, with the region at the right hand."""

# Steps along the lattice: east, south, west, north.
_DX = np.array([1, 0, -1, 0])
_DY = np.array([0, 1, 0, -1])

# For each of them the quadrants left and right of it.
_BESIDE = {
    (1, 0): ((1, 0), (1, 1)),
    (0, 1): ((1, 1), (0, 1)),
    (-1, 0): ((0, 1), (0, 0)),
    (0, -1): ((0, 0), (1, 0)),
}


class Edge(Protocol):
    """What two regions share from node to node: an arc or a curve."""

    @property
    def left(self) -> int: ...

    @property
    def right(self) -> int: ...

    @property
    def start(self) -> int: ...

    @property
    def end(self) -> int: ...

    @property
    def closed(self) -> bool: ...


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

    Loops keep the region at the right hand, so the outer one has positive area in image coordinates and holes
    have negative area.
    """

    nodes: NDArray[np.int32]
    arcs: tuple[Arc, ...]
    loops: tuple[tuple[Loop, ...], ...]


@kernel
def _cracks(padded):
    """`(h+1, w+1) uint8`: bit d is set where a crack leaves this lattice point to the east, south, west,
    north; and the number of cracks."""
    height, width = padded.shape[0] - 1, padded.shape[1] - 1
    cracks = np.empty((height, width), np.uint8)
    total = 0
    for y in range(height):
        for x in range(width):
            north_west, north_east = padded[y, x], padded[y, x + 1]
            south_west, south_east = padded[y + 1, x], padded[y + 1, x + 1]
            east, south = north_east != south_east, south_west != south_east
            west, north = north_west != south_west, north_west != north_east
            cracks[y, x] = east + 2 * south + 4 * west + 8 * north
            total += east + south
    return cracks, total


@kernel
def _nodes(cracks):
    """`(k, 2) int32` lattice points that are nodes, in raster order, and `(h+1, w+1) int32` their numbers, -1
    elsewhere."""
    height, width = cracks.shape
    node_at = np.full((height, width), -1, np.int32)
    count = 0
    for y in range(height):
        for x in range(width):
            bits = cracks[y, x]
            corner = (y == 0 or y == height - 1) and (x == 0 or x == width - 1)
            if corner or (bits & 1) + (bits >> 1 & 1) + (bits >> 2 & 1) + (bits >> 3) >= 3:
                node_at[y, x] = count
                count += 1
    nodes = np.empty((count, 2), np.int32)
    for y in range(height):
        for x in range(width):
            if node_at[y, x] >= 0:
                nodes[node_at[y, x], 0], nodes[node_at[y, x], 1] = x, y
    return nodes, node_at


@kernel
def _trace(cracks, total, nodes, node_at):
    """Walk every crack once: first from the nodes, then around what meets none.

    Returns the visited lattice points one arc after another, and the arcs' first indices in them.
    """
    todo = cracks.copy()
    # An arc has one point more than cracks.
    points = np.empty((2 * total + 1, 2), np.int32)
    offsets = np.empty(total + 2, np.int64)
    n_points, n_arcs = 0, 0
    for k in range(len(nodes)):
        for d in range(4):
            if todo[nodes[k, 1], nodes[k, 0]] >> d & 1:
                offsets[n_arcs] = n_points
                n_arcs += 1
                n_points = _walk(cracks, todo, node_at, nodes[k, 0], nodes[k, 1], d, points, n_points)
    height, width = cracks.shape
    for y in range(height):
        for x in range(width):
            for d in range(4):
                if todo[y, x] >> d & 1:
                    offsets[n_arcs] = n_points
                    n_arcs += 1
                    n_points = _walk(cracks, todo, node_at, x, y, d, points, n_points)
    offsets[n_arcs] = n_points
    return points[:n_points].copy(), offsets[: n_arcs + 1].copy()


@kernel
def _walk(cracks, todo, node_at, x0, y0, d, points, n_points):
    """Write the lattice points from (x0, y0), leaving it in the direction d, to the next node or back;
    returns the new number of points."""
    x, y = x0, y0
    points[n_points, 0], points[n_points, 1] = x, y
    n_points += 1
    while True:
        todo[y, x] &= ~np.uint8(1 << d)
        x += _DX[d]
        y += _DY[d]
        back = (d + 2) % 4
        todo[y, x] &= ~np.uint8(1 << back)
        points[n_points, 0], points[n_points, 1] = x, y
        n_points += 1
        if node_at[y, x] >= 0 or (x == x0 and y == y0):
            return n_points
        for turn in range(4):
            if turn != back and cracks[y, x] >> turn & 1:
                d = turn
                break


def planar_graph(labels: NDArray[np.int32]) -> PlanarGraph:
    """Graph of the borders of a label map.

    `labels` is `(h, w) int32` with regions numbered 0..n-1, each 4-connected.
    """
    padded = np.pad(labels, 1, constant_values=OUTSIDE)
    cracks, total = _cracks(padded)
    nodes, node_at = _nodes(cracks)
    points, offsets = _trace(cracks, total, nodes, node_at)
    arcs = tuple(_arc(points[a:b], padded, node_at) for a, b in zip(offsets[:-1], offsets[1:], strict=True))
    return PlanarGraph(nodes, arcs, _loops(arcs, int(labels.max()) + 1))


def _arc(points: NDArray[np.int32], padded: NDArray[np.int32], node_at: NDArray[np.int32]) -> Arc:
    (x, y), (x1, y1) = points[:2].tolist()
    # Quadrants around the first lattice point, in the padded map: [y, x] is its north-west pixel.
    left, right = (padded[y + v, x + u] for u, v in _BESIDE[x1 - x, y1 - y])
    last = points[-1]
    return Arc(points, int(left), int(right), int(node_at[y, x]), int(node_at[last[1], last[0]]))


def _direction(a: NDArray[np.int32], b: NDArray[np.int32]) -> int:
    step = (int(b[0] - a[0]), int(b[1] - a[1]))
    return {(1, 0): 0, (0, 1): 1, (-1, 0): 2, (0, -1): 3}[step]


def _loops(arcs: tuple[Arc, ...], n_regions: int) -> tuple[tuple[Loop, ...], ...]:
    """Boundary loops of every region.

    Where a region touches itself at a diagonal crossing, the walk stays at the same pixel, because regions
    are 4-connected: the quadrant at the right hand of the arriving step is that of the leaving one. Right of
    an eastward arrival lies the south-west quadrant, which is right of a southward leave.
    """

    def turn(arriving: Half, leaving: Half) -> int:
        arrived, left = _walked(arcs, arriving), _walked(arcs, leaving)
        return (_direction(arrived[-2], arrived[-1]) + 1 - _direction(left[0], left[1])) % 4

    return walked_loops(arcs, n_regions, turn)


def _walked(arcs: tuple[Arc, ...], half: Half) -> NDArray[np.int32]:
    arc, forward = half
    return arcs[arc].points if forward else arcs[arc].points[::-1]


def walked_loops(
    edges: Sequence[Edge], n_regions: int, turn: Callable[[Half, Half], float]
) -> tuple[tuple[Loop, ...], ...]:
    """Loops of every region, the region at the right hand. `ValueError` where edges do not close.

    Where a region touches itself at a node, the walk goes from the one half that arrives there to the other
    that leaves for which `turn` is least: it has to be the sharpest turn to the right.
    """
    leaving: dict[tuple[int, int], list[Half]] = {}
    halves: list[tuple[int, Half]] = []
    for e, edge in enumerate(edges):
        for forward, region, node in ((True, edge.right, edge.start), (False, edge.left, edge.end)):
            if region == OUTSIDE:
                continue
            halves.append((region, (e, forward)))
            if not edge.closed:
                leaving.setdefault((node, region), []).append((e, forward))
    loops: list[list[Loop]] = [[] for _ in range(n_regions)]
    done: set[Half] = set()
    for region, first in halves:
        if first in done:
            continue
        loop: list[Half] = []
        half = first
        while half not in done:
            done.add(half)
            loop.append(half)
            edge = edges[half[0]]
            if edge.closed:
                break
            node = edge.end if half[1] else edge.start
            candidates = [h for h in leaving.get((node, region), []) if h not in done or h == first]
            if not candidates:
                raise ValueError("curves that do not close around a patch")
            half = candidates[0] if len(candidates) == 1 else min(candidates, key=partial(turn, half))
        loops[region].append(tuple(loop))
    if not all(loops):
        raise ValueError("a patch without a boundary")
    return tuple(tuple(region_loops) for region_loops in loops)
