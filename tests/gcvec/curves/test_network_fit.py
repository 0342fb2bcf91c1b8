"""Which borders go back to how they were traced where curves cross, and what goes with them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from gcvec.borders.border import Borders, sample_borders
from gcvec.borders.chains import chains_of
from gcvec.borders.planar_graph import planar_graph
from gcvec.curves.network_fit import (
    HALF_TRACED,
    NEAR_NODE,
    TRACED,
    _inside_out,
    _mixed,
    _Turns,
    fitted_network,
)
from gcvec.quantization import Quantization
from tests.gcvec.areas import shoelace
from tests.gcvec.scenes import SCENES, voronoi

SHIFT = 0.25


@cache
def traced() -> Borders:
    made = voronoi(120, 160, 12, 1)
    return sample_borders(planar_graph(made.labels), made.width, made.height)


@cache
def localized() -> Borders:
    """All samples and nodes off the frame moved, so that each can be told from where it was traced."""
    found, chains = traced(), chains_of(traced())
    inside = ((found.nodes > 0) & (found.nodes < [found.width, found.height])).all(axis=1)
    points = chains.joined([border.samples for border in found.borders]) + SHIFT
    return chains.put_back(found, found.nodes + SHIFT * inside[:, None], points, np.ones(len(points)))


def tries(**of_borders: int) -> np.ndarray:
    """No tries but these, by the number of the border, `b7=2`."""
    made = np.zeros(len(traced().borders), np.int64)
    for name, value in of_borders.items():
        made[int(name[1:])] = value
    return made


def inner() -> list[int]:
    """Borders off the frame, long enough for both ends to be told apart, between nodes off the frame."""
    moved = (localized().nodes != traced().nodes).all(axis=1)
    return [
        k
        for k, border in enumerate(traced().borders)
        if not border.on_frame
        and len(border.samples) > 3 * NEAR_NODE
        and moved[[border.start, border.end]].all()
    ]


def two_at_a_node() -> tuple[int, int, int]:
    """Two borders that end in the same node, and the node."""
    for k in inner():
        for other in inner():
            ends = [{traced().borders[b].start, traced().borders[b].end} for b in (k, other)]
            if k != other and len(ends[0] & ends[1]) == 1:
                return k, other, (ends[0] & ends[1]).pop()
    raise AssertionError


def is_traced(found: Borders, k: int) -> np.ndarray:
    """Which samples of a border lie where they were traced."""
    return np.asarray((found.borders[k].samples == traced().borders[k].samples).all(axis=1))


def assert_ends_at_nodes(found: Borders) -> None:
    for border in found.borders:
        if not border.closed:
            np.testing.assert_array_equal(border.samples[[0, -1]], found.nodes[[border.start, border.end]])


@pytest.mark.parametrize("value", range(HALF_TRACED))
def test_at_first_all_borders_are_those_of_the_photo(value: int) -> None:
    found = _mixed(traced(), localized(), np.full(len(traced().borders), value))
    assert all(a is b for a, b in zip(found.borders, localized().borders, strict=True))
    np.testing.assert_array_equal(found.nodes, localized().nodes)


def assert_back_with_its_nodes(found: Borders, k: int) -> None:
    border = traced().borders[k]
    assert is_traced(found, k).all()
    for node in (border.start, border.end):
        np.testing.assert_array_equal(found.nodes[node], traced().nodes[node])


@pytest.mark.parametrize("value", [HALF_TRACED, TRACED])
def test_a_border_that_fails_alone_goes_back_with_its_nodes(value: int) -> None:
    """And those that end there end in them; the rest of them stays."""
    k = inner()[0]
    found = _mixed(traced(), localized(), tries(**{f"b{k}": value}))
    assert_back_with_its_nodes(found, k)
    back = (found.nodes != localized().nodes).any(axis=1)
    assert set(np.flatnonzero(back)) == {traced().borders[k].start, traced().borders[k].end}
    for b, other in enumerate(found.borders):
        if b != k:
            np.testing.assert_array_equal(other.samples[1:-1], localized().borders[b].samples[1:-1])
    assert_ends_at_nodes(found)


def test_two_that_fail_at_a_node_go_back_near_it() -> None:
    k, other, node = two_at_a_node()
    found = _mixed(traced(), localized(), tries(**{f"b{k}": HALF_TRACED, f"b{other}": HALF_TRACED}))
    np.testing.assert_array_equal(found.nodes[node], traced().nodes[node])
    for b in (k, other):
        back = is_traced(found, b)
        near = np.arange(len(back)) < NEAR_NODE
        np.testing.assert_array_equal(back, near if traced().borders[b].start == node else near[::-1])
    others = np.delete(np.arange(len(found.nodes)), node)
    np.testing.assert_array_equal(found.nodes[others], localized().nodes[others])
    assert_ends_at_nodes(found)


def test_one_that_meets_others_at_both_ends_goes_back_whole() -> None:
    k = inner()[0]
    border = traced().borders[k]
    at_ends = [
        next(b for b, other in enumerate(traced().borders) if b != k and node in (other.start, other.end))
        for node in (border.start, border.end)
    ]
    found = _mixed(traced(), localized(), tries(**{f"b{b}": HALF_TRACED for b in (k, *at_ends)}))
    assert_back_with_its_nodes(found, k)
    assert_ends_at_nodes(found)


def test_one_that_fails_again_goes_back_whole() -> None:
    k, other, _ = two_at_a_node()
    found = _mixed(traced(), localized(), tries(**{f"b{k}": TRACED, f"b{other}": HALF_TRACED}))
    assert_back_with_its_nodes(found, k)
    assert is_traced(found, other).sum() == NEAR_NODE
    assert_ends_at_nodes(found)


def areas_of_loops(rows: list[np.ndarray]) -> list[float]:
    """Twice the area inside each loop, of samples from node to node."""
    loops = [loop for region in traced().loops for loop in region]
    rings = [np.concatenate([rows[k][:: 1 if forward else -1][:-1] for k, forward in loop]) for loop in loops]
    return [2 * shoelace(ring) for ring in rings]


def test_areas_are_those_of_the_loops() -> None:
    rows = [border.samples for border in localized().borders]
    found = _Turns(traced().loops, localized()).area
    np.testing.assert_allclose(found, areas_of_loops(rows), atol=1e-6)


def test_loops_close_where_borders_end_beside_their_nodes() -> None:
    """As those do that met in another node before junctions were united."""
    beside, rows = [], []
    for border in traced().borders:
        cut = border if border.closed else replace(border, samples=border.samples[1:-1])
        ends = traced().nodes[[border.start, border.end]]
        beside.append(cut)
        rows.append(cut.samples if border.closed else np.concatenate([ends[:1], cut.samples[1:-1], ends[1:]]))
    found = _Turns(traced().loops, replace(traced(), borders=tuple(beside))).area
    np.testing.assert_allclose(found, areas_of_loops(rows), atol=1e-6)


def test_a_loop_that_has_turned_over_is_noticed() -> None:
    """The borders of a region mirrored: all of them but those on the frame are wrong, and no others."""
    network = fitted_network(traced(), traced(), Quantization().grid)
    before = _Turns(traced().loops, traced())
    assert not len(_inside_out(network, traced(), before))
    region = next(
        r for r, (loop, *_) in enumerate(traced().loops) if any(traced().borders[k].on_frame for k, _ in loop)
    )
    count = sum(len(loops) for loops in traced().loops[:region])
    before.area[count] *= -1
    wrong = _inside_out(network, traced(), before)
    assert sorted(wrong) == sorted(
        k for k, _ in traced().loops[region][0] if not traced().borders[k].on_frame
    )


def test_curves_of_regions_a_pixel_wide_cross_nowhere() -> None:
    """They end as they were traced: through the nodes of the label map."""
    made = SCENES["stripes"]
    found = sample_borders(planar_graph(made.labels), made.width, made.height)
    network = fitted_network(found, found)
    assert len(network.curves) == len(found.borders)
    for curve, border in zip(network.curves, found.borders, strict=True):
        if not curve.closed:
            np.testing.assert_array_equal(curve.control_points[[0, -1]], border.samples[[0, -1]])
