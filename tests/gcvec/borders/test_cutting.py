"""Borders cut at corners: every sample once, the same cuts in what was traced and what was placed."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders.border import Borders, sample_borders
from gcvec.borders.chains import Chains
from gcvec.borders.corners import Corners
from gcvec.borders.cutting import Turn, _cut, _lattice_point, _told_once
from gcvec.borders.planar_graph import planar_graph
from gcvec.borders.stroke_ends import StrokeEnds
from tests.gcvec.borders.walks import assert_whole
from tests.gcvec.scenes import SCENES


def ring_and_cross() -> Borders:
    """Four regions that meet in one node, and a fifth inside one of them, whose border is closed."""
    labels = np.zeros((40, 44), np.int32)
    labels[:20, 22:], labels[20:, :22], labels[20:, 22:] = 1, 2, 3
    labels[25:35, 28:38] = 4
    return sample_borders(planar_graph(labels), 44, 40)


@pytest.mark.parametrize("cuts", [[3], [3, 11], [0, 16, 17]])
@pytest.mark.parametrize("closed", [False, True])
def test_pieces_of_a_border_are_the_border(closed: bool, cuts: list[int]) -> None:
    """Its samples in order, none twice, with a node, which nobody knows for sure, where it was cut."""
    before = ring_and_cross()
    k = next(k for k, b in enumerate(before.borders) if not b.on_frame and b.closed == closed)
    border = before.borders[k]
    places = {c: np.array([c, 0.5]) for c in cuts}
    after = _cut(before, {k: [Turn(c, place) for c, place in places.items()]})
    assert_whole(after)
    pieces = after.borders[k : k + len(cuts) + (not closed)]
    assert len(after.borders) == len(before.borders) + len(pieces) - 1
    assert len(after.nodes) == len(before.nodes) + len(cuts)
    assert all((p.left, p.right) == (border.left, border.right) for p in pieces)
    walked = np.concatenate([piece.samples[1:-1] for piece in pieces])
    own = np.roll(border.samples[:-1], -cuts[0] - 1, axis=0) if closed else border.samples[1:-1]
    np.testing.assert_array_equal(walked, own)
    between = [piece.samples[0] for piece in pieces[(not closed) :]]
    np.testing.assert_array_equal(between, list(places.values()))
    assert all(piece.trust[[0, -1]].tolist() == [0, 0] and (piece.trust[1:-1] == 1).all() for piece in pieces)


def test_borders_without_corners_stay_as_they_are() -> None:
    before = ring_and_cross()
    after = _cut(before, {})
    for a, b in zip(before.borders, after.borders, strict=True):
        assert a.samples is b.samples
        assert (a.start, a.end) == (b.start, b.end)
    np.testing.assert_array_equal(before.nodes, after.nodes)


@pytest.mark.parametrize("scene", ["voronoi", "stripes"])
def test_between_two_cracks_lies_the_lattice_point_that_they_share(scene: str) -> None:
    for arc in planar_graph(SCENES[scene].labels).arcs:
        middles = (arc.points[1:] + arc.points[:-1]) / 2
        for k in range(len(middles) - 1):
            np.testing.assert_array_equal(_lattice_point(middles, k), arc.points[k + 1])


@pytest.mark.parametrize("closed", [False, True])
def test_what_is_told_twice_is_cut_once(closed: bool) -> None:
    """An end of a stroke with one corner seen by itself, one with both, one on another border with none."""
    nodes = np.full((2, 2), -1) if closed else np.arange(4).reshape(2, 2)
    chains = Chains(np.arange(2), np.full(2, closed), nodes, np.array([0, 60, 100]))
    single = Corners(np.array([8, 30, 33, 50, 99]), np.zeros((5, 2)))
    ends = StrokeEnds(np.array([[9, 11], [29, 32], [80, 82]]), np.zeros((3, 2, 2)))
    alone, needed = _told_once(chains, single, ends)
    assert alone.tolist() == [False, True, True, True, True]
    assert needed.tolist() == [True, False, True]
