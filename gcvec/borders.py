"""Planar graph → borders: arcs cut at real corners, as rows of samples.

A border runs from node to node, or closes on itself where it meets none. Its samples are the mid-points of
its cracks, and, at the ends, the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcvec.planar_graph import OUTSIDE, Arc, PlanarGraph

Floats = NDArray[np.float64]

CORNER_WINDOW = 5
CORNER_ANGLE = np.deg2rad(55.0)
"""An arc turns a corner where the chords over the window before and after a sample meet at this angle or
more."""

Loop = tuple[tuple[int, bool], ...]
"""A closed walk over borders, `(border, forward)`, with the region at the right hand."""


@dataclass(frozen=True)
class Border:
    """A smooth piece of the border between the regions `left` and `right` (-1: outside the image).

    `samples` is `(n, 2) float64`, pixels, in walking order. `start` and `end` are nodes, -1 each for a
    closed border, which
    repeats its first sample at the end.
    """

    samples: Floats
    left: int
    right: int
    start: int
    end: int

    @property
    def closed(self) -> bool:
        return self.start < 0

    @property
    def on_frame(self) -> bool:
        return self.left == OUTSIDE or self.right == OUTSIDE


@dataclass(frozen=True)
class Borders:
    """All borders of a picture. `loops[r]` bounds region r; `nodes` `(k, 2) float64` are junctions and
    corners."""

    width: int
    height: int
    nodes: Floats
    borders: tuple[Border, ...]
    loops: tuple[tuple[Loop, ...], ...]


def borders(graph: PlanarGraph, width: int, height: int) -> Borders:
    """The borders of a label map's planar graph."""
    nodes = [(float(x), float(y)) for x, y in graph.nodes]
    found: list[Border] = []
    pieces_of: list[list[int]] = []
    for arc in graph.arcs:
        ends, runs = _cut_at_corners(arc, nodes)
        pieces_of.append(list(range(len(found), len(found) + len(runs))))
        found += [
            Border(samples, arc.left, arc.right, start, end)
            for (start, end), samples in zip(ends, runs, strict=True)
        ]
    loops = tuple(
        tuple(
            tuple(
                (c, forward) for a, forward in loop for c in (pieces_of[a] if forward else pieces_of[a][::-1])
            )
            for loop in region
        )
        for region in graph.loops
    )
    return _with_nodes_in_order(Borders(width, height, np.array(nodes), tuple(found), loops))


def _with_nodes_in_order(found: Borders) -> Borders:
    """The same with nodes numbered in the order in which the borders meet them, as the file has them."""
    met = np.array([node for b in found.borders if not b.closed for node in (b.start, b.end)], np.int64)
    order = met[np.sort(np.unique(met, return_index=True)[1])]
    number = np.full(len(found.nodes), -1)
    number[order] = np.arange(len(order))
    renumbered = tuple(
        b if b.closed else replace(b, start=int(number[b.start]), end=int(number[b.end]))
        for b in found.borders
    )
    return replace(found, nodes=found.nodes[order], borders=renumbered)


def between_nodes(border: Border, nodes: Floats) -> Border:
    """The border with its ends at `nodes` `(k, 2)`."""
    if border.closed:
        return border
    samples = np.concatenate([nodes[border.start][None], border.samples[1:-1], nodes[border.end][None]])
    return replace(border, samples=samples)


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
