"""Planar graph → borders: arcs as rows of samples.

A border runs from node to node, or closes on itself where it meets none. Its samples are the mid-points of
its cracks, and, at the ends, the nodes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import OUTSIDE, Arc, Loop, PlanarGraph

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Border:
    """A piece of the border between the regions `left` and `right` (-1: outside the image).

    `samples` is `(n, 2) float64`, pixels, in walking order; `trust` `(n,)` in [0, 1] is how surely each is
    known. `start` and `end` are nodes, -1 each for a closed border, which repeats its first sample at the
    end.
    """

    samples: Floats
    trust: Floats
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

    def through(self, samples: Floats, trust: Floats) -> Border:
        """The same border through other samples."""
        return Border(samples, trust, self.left, self.right, self.start, self.end)

    def between(self, start: int, end: int) -> Border:
        """The same border with other numbers of its nodes."""
        return Border(self.samples, self.trust, self.left, self.right, start, end)


@dataclass(frozen=True)
class Borders:
    """All borders of a picture. `loops[r]` bounds region r, a walk over borders as over arcs; `nodes`
    `(k, 2) float64` are junctions and corners."""

    width: int
    height: int
    nodes: Floats
    borders: tuple[Border, ...]
    loops: tuple[tuple[Loop, ...], ...]


def sample_borders(graph: PlanarGraph, width: int, height: int) -> Borders:
    """The borders of a label map's planar graph, one an arc."""
    found = tuple(_border(arc) for arc in graph.arcs)
    return with_nodes_in_order(Borders(width, height, graph.nodes.astype(np.float64), found, graph.loops))


def _border(arc: Arc) -> Border:
    lattice = arc.points.astype(np.float64)
    middles = (lattice[1:] + lattice[:-1]) / 2
    runs = (middles, middles[:1]) if arc.closed else (lattice[:1], middles, lattice[-1:])
    samples = np.concatenate(runs)
    return Border(samples, np.ones(len(samples)), arc.left, arc.right, arc.start, arc.end)


def with_nodes_in_order(found: Borders) -> Borders:
    """The same with nodes numbered in the order in which the borders meet them, as the file has them."""
    met = np.array([node for b in found.borders if not b.closed for node in (b.start, b.end)], np.int64)
    order = met[np.sort(np.unique(met, return_index=True)[1])]
    number = np.full(len(found.nodes), -1)
    number[order] = np.arange(len(order))
    renumbered = tuple(
        b if b.closed else b.between(int(number[b.start]), int(number[b.end])) for b in found.borders
    )
    return replace(found, nodes=found.nodes[order], borders=renumbered)


def between_nodes(border: Border, nodes: Floats) -> Border:
    """The border with its ends at `nodes` `(k, 2)`."""
    if border.closed:
        return border
    samples = border.samples.copy()
    samples[0], samples[-1] = nodes[border.start], nodes[border.end]
    return border.through(samples, border.trust)
