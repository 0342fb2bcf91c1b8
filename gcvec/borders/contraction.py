"""Junctions of four and more regions.

A label map shows most of them as two junctions of three with a border of a pixel or two between. Where the
other borders point at one place, that border goes and the two junctions become one.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Border, Borders, with_nodes_in_order
from gcvec.borders.planar_graph import MOST_AT_NODE

Floats = NDArray[np.float64]

MOST_SAMPLES = 5
"""Samples of a border that may vanish, nodes included."""

LEAST_SAMPLES = 8
"""Samples of every other border that ends at its nodes: shorter ones do not point anywhere."""

SAME_PLACE = 0.75
"""Nodes nearer than this to each other are one junction, pixels."""


def without_shortest(traced: Borders, placed: Borders) -> tuple[Borders, Borders]:
    """Both without the borders that have shrunk to a point in `placed`, their nodes united half-way."""
    ends = Counter(node for b in traced.borders if not b.closed for node in (b.start, b.end))
    in_loop = [Counter(k for k, _ in loop) for region in traced.loops for loop in region]
    left_in_loop = [len(loop) for region in traced.loops for loop in region]
    loops_of = {k: [i for i, own in enumerate(in_loop) if k in own] for k in _shrunk(traced, placed)}
    united: dict[int, int] = {}
    gone = set()
    for k, loops in loops_of.items():
        a, b = traced.borders[k].start, traced.borders[k].end
        if a in united or b in united or min(left_in_loop[i] for i in loops) < 3:
            continue
        if ends[a] + ends[b] - 2 <= MOST_AT_NODE:
            gone.add(k)
            united |= {a: a, b: a}
            for i in loops:
                left_in_loop[i] -= 1
    if not gone:
        return traced, placed
    return _without(traced, gone, united), _without(placed, gone, united)


def _shrunk(traced: Borders, placed: Borders) -> list[int]:
    at_node: dict[int, list[Border]] = {}
    for border in traced.borders:
        if not border.closed:
            at_node.setdefault(border.start, []).append(border)
            at_node.setdefault(border.end, []).append(border)
    found = []
    for k, border in enumerate(traced.borders):
        if border.closed or border.on_frame or border.start == border.end:
            continue
        others = [b for node in (border.start, border.end) for b in at_node[node] if b is not border]
        if len(border.samples) > MOST_SAMPLES or min(len(b.samples) for b in others) < LEAST_SAMPLES:
            continue
        if any(b.on_frame for b in others):
            continue
        way = placed.nodes[border.end] - placed.nodes[border.start]
        drawn = traced.nodes[border.end] - traced.nodes[border.start]
        if np.hypot(*way) < SAME_PLACE or way @ drawn < 0:
            found.append(k)
    return found


def _without(found: Borders, gone: set[int], united: dict[int, int]) -> Borders:
    """The borders but those that are `gone`; nodes become those that they are `united` with."""
    nodes = found.nodes.copy()
    for k in gone:
        a, b = found.borders[k].start, found.borders[k].end
        nodes[united[a]] = (found.nodes[a] + found.nodes[b]) / 2
    kept = [k for k in range(len(found.borders)) if k not in gone]
    number = {k: i for i, k in enumerate(kept)}
    borders = []
    for border in (found.borders[k] for k in kept):
        start, end = united.get(border.start, border.start), united.get(border.end, border.end)
        borders.append(border if border.closed else border.between(start, end))
    loops = tuple(
        tuple(tuple((number[k], forward) for k, forward in loop if k not in gone) for loop in region)
        for region in found.loops
    )
    return with_nodes_in_order(replace(found, nodes=nodes, borders=tuple(borders), loops=loops))
