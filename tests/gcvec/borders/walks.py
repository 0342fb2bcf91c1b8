"""Whether borders, nodes and loops belong together."""

from __future__ import annotations

import numpy as np

from gcvec.borders.border import Borders
from gcvec.borders.planar_graph import Loop
from gcvec.curves.loops import network_loops
from gcvec.curves.network import Curve


def assert_whole(found: Borders) -> None:
    """Every border runs between its nodes, and the loops are those that the borders form."""
    curves = []
    for border in found.borders:
        points = border.samples
        if not border.closed:
            assert 0 <= border.start < len(found.nodes)
            assert 0 <= border.end < len(found.nodes)
            points = np.concatenate([found.nodes[[border.start]], points[1:-1], found.nodes[[border.end]]])
        curves.append(Curve(points, border.left, border.right, border.start, border.end))
    formed = network_loops(tuple(curves), len(found.loops))
    for ours, theirs in zip(found.loops, formed, strict=True):
        assert sorted(map(_from_least, ours)) == sorted(map(_from_least, theirs))


def _from_least(loop: Loop) -> Loop:
    first = loop.index(min(loop))
    return loop[first:] + loop[:first]
