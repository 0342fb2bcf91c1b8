"""Junctions of four and more regions.

A label map shows most of them as two junctions of three with a border of a pixel or two between. Where the
other borders point at one place, that border goes and the two junctions become one.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Border, Borders, with_nodes_in_order

Floats = NDArray[np.float64]

MOST_SAMPLES = 5
"""Samples of a border that may vanish, nodes included: too few for one that comes back to its node."""

LEAST_SAMPLES = 8
"""Samples of every other border that ends at its nodes: shorter ones do not point anywhere."""

SAME_PLACE = 0.75
"""Nodes nearer than this to each other are one junction, pixels."""


def without_shortest(traced: Borders, placed: Borders) -> tuple[Borders, Borders]:
    """Both without the borders that have shrunk to a point in `placed`, their nodes united half-way.

    No node is united twice, since the borders beside one that goes are long. Regions keep two borders.
    """
    needed = {k for region in traced.loops for loop in region if len(loop) < 3 for k, _ in loop}
    gone = set(_shrunk(traced, placed)) - needed
    if not gone:
        return traced, placed
    return _without(traced, gone), _without(placed, gone)


def _shrunk(traced: Borders, placed: Borders) -> list[int]:
    """The borders that are short, have long ones beside them, and whose nodes have come together or have
    passed each other; none that is on the frame or ends there, where another on the frame is beside it."""
    at_node: dict[int, list[Border]] = {}
    for border in traced.borders:
        if not border.closed:
            at_node.setdefault(border.start, []).append(border)
            at_node.setdefault(border.end, []).append(border)
    found = []
    for k, border in enumerate(traced.borders):
        if border.closed or len(border.samples) > MOST_SAMPLES:
            continue
        others = [b for node in (border.start, border.end) for b in at_node[node] if b is not border]
        if any(b.on_frame or len(b.samples) < LEAST_SAMPLES for b in others):
            continue
        way = placed.nodes[border.end] - placed.nodes[border.start]
        drawn = traced.nodes[border.end] - traced.nodes[border.start]
        if np.hypot(*way) < SAME_PLACE or way @ drawn < 0:
            found.append(k)
    return found


def _without(found: Borders, gone: set[int]) -> Borders:
    """The borders but those that are `gone`, each of whose ends become one node."""
    nodes, united = found.nodes.copy(), dict[int, int]()
    for k in gone:
        start, end = found.borders[k].start, found.borders[k].end
        nodes[start] = (found.nodes[start] + found.nodes[end]) / 2
        united[end] = start
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
