"""Two junctions of three that are really one of four."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from gcvec.borders.border import Borders, sample_borders
from gcvec.borders.contraction import LEAST_SAMPLES, MOST_SAMPLES, SAME_PLACE, without_shortest
from gcvec.borders.planar_graph import MOST_AT_NODE, planar_graph
from gcvec.regions.components import connected_components
from tests.gcvec.borders.walks import assert_whole

SIDE = 40


def of_labels(labels: np.ndarray) -> Borders:
    height, width = labels.shape
    return sample_borders(planar_graph(labels), width, height)


def offset_cross(gap: int, above: int = SIDE // 2) -> Borders:
    """Four regions; the border between the lower two stands `gap` pixels right of that between the upper,
    which is `above` pixels long."""
    labels = np.zeros((above + SIDE // 2, SIDE), np.int32)
    labels[:above, SIDE // 2 :] = 1
    labels[above:] = 2
    labels[above:, SIDE // 2 + gap :] = 3
    return of_labels(labels)


def between(found: Borders, *regions: int) -> int:
    """The border that parts two regions."""
    (k,) = (k for k, border in enumerate(found.borders) if {border.left, border.right} == {*regions})
    return k


def moved_to(traced: Borders, places: dict[int, tuple[float, float]]) -> Borders:
    """The borders with some of their nodes elsewhere."""
    nodes = traced.nodes.copy()
    for node, place in places.items():
        nodes[node] = place
    return replace(traced, nodes=nodes)


def shrunk(traced: Borders, way: tuple[float, float] = (0.0, 0.0)) -> Borders:
    """The short border between the regions 1 and 2 drawn from (21, 20) along this way, as it runs."""
    short = traced.borders[between(traced, 1, 2)]
    return moved_to(traced, {short.start: (21.0, 20.0), short.end: (21.0 + way[0], 20.0 + way[1])})


def way_of(traced: Borders, length: float) -> tuple[float, float]:
    """So far along the short border as it was traced."""
    short = traced.borders[between(traced, 1, 2)]
    drawn = traced.nodes[short.end] - traced.nodes[short.start]
    x, y = length * drawn / np.hypot(*drawn)
    return float(x), float(y)


def test_a_border_that_has_shrunk_to_a_point_goes_and_its_nodes_become_one() -> None:
    traced = offset_cross(2)
    found = without_shortest(traced, shrunk(traced, way_of(traced, 0.5)))
    for before, after in zip((traced, shrunk(traced, way_of(traced, 0.5))), found, strict=True):
        assert len(after.borders) == len(before.borders) - 1
        assert len(after.nodes) == len(before.nodes) - 1
        short = before.borders[between(before, 1, 2)]
        half_way = (before.nodes[short.start] + before.nodes[short.end]) / 2
        ends = [n for pair in ((0, 1), (2, 3), (0, 2), (1, 3)) for n in _inner_ends(after, *pair)]
        assert len(ends) == 4
        assert len(set(ends)) == 1
        np.testing.assert_allclose(after.nodes[ends[0]], half_way)
    assert_whole(found[0])


def _inner_ends(found: Borders, a: int, b: int) -> list[int]:
    border = found.borders[between(found, a, b)]
    on_frame = [(found.nodes[n] % SIDE == 0).any() for n in (border.start, border.end)]
    return [n for n, outer in zip((border.start, border.end), on_frame, strict=True) if not outer]


def test_loops_pass_over_what_is_gone() -> None:
    traced = offset_cross(2)
    k = between(traced, 1, 2)
    found, _ = without_shortest(traced, shrunk(traced))
    for before, after in zip(traced.loops, found.loops, strict=True):
        walks = [[(c - (c > k), forward) for c, forward in loop if c != k] for loop in before]
        assert [list(loop) for loop in after] == walks


@pytest.mark.parametrize(("length", "goes"), [(SAME_PLACE - 0.01, True), (SAME_PLACE + 0.01, False)])
def test_only_nodes_in_the_same_place_become_one(length: float, goes: bool) -> None:
    traced = offset_cross(2)
    found, _ = without_shortest(traced, shrunk(traced, way_of(traced, length)))
    assert (len(found.borders) < len(traced.borders)) is goes


def test_a_border_whose_nodes_have_passed_each_other_goes_however_far() -> None:
    traced = offset_cross(2)
    found, _ = without_shortest(traced, shrunk(traced, way_of(traced, -3.0)))
    assert len(found.borders) == len(traced.borders) - 1


@pytest.mark.parametrize("gap", [1, MOST_SAMPLES - 2, MOST_SAMPLES - 1])
def test_a_long_border_stays(gap: int) -> None:
    """One of `gap` cracks has as many samples and two nodes."""
    traced = offset_cross(gap)
    assert len(traced.borders[between(traced, 1, 2)].samples) == gap + 2
    found, _ = without_shortest(traced, shrunk(traced))
    assert (len(found.borders) < len(traced.borders)) is (gap + 2 <= MOST_SAMPLES)


@pytest.mark.parametrize("samples", [LEAST_SAMPLES - 1, LEAST_SAMPLES])
def test_beside_a_short_border_nothing_goes(samples: int) -> None:
    """It points nowhere. One of so many samples has two nodes among them."""
    traced = offset_cross(2, samples - 2)
    assert len(traced.borders[between(traced, 0, 1)].samples) == samples
    found, _ = without_shortest(traced, shrunk(traced))
    assert (len(found.borders) < len(traced.borders)) is (samples >= LEAST_SAMPLES)


def test_borders_that_end_at_the_frame_beside_it_stay() -> None:
    """A node on the frame is where the picture ends, not where borders meet."""
    labels = np.zeros((SIDE, SIDE), np.int32)
    labels[2:, 20:] = 1
    labels[:2, 20:] = 2
    traced = of_labels(labels)
    short = between(traced, 0, 2)
    assert len(traced.borders[short].samples) <= MOST_SAMPLES
    nodes = {traced.borders[short].start: (20.0, 1.0), traced.borders[short].end: (20.0, 1.0)}
    found, placed = without_shortest(traced, moved_to(traced, nodes))
    assert found is traced
    assert len(placed.borders) == len(traced.borders)


@pytest.mark.parametrize(("sides", "goes"), [(1, False), (2, True)])
def test_no_region_is_left_with_a_single_border(sides: int, goes: bool) -> None:
    """One that hangs from another by a neck, with one region around the rest of it, or with two."""
    labels = np.zeros((SIDE, SIDE), np.int32)
    labels[:20] = 1
    labels[20:, 20:] = 3 if sides == 2 else 0
    labels[20:30, 19:21] = 2
    labels[24:30, 14:26] = 2
    traced = of_labels(labels)
    (loop,) = traced.loops[2]
    assert len(loop) == sides + 1
    neck = traced.borders[between(traced, 1, 2)]
    found, _ = without_shortest(traced, moved_to(traced, {neck.start: (20.0, 20.0), neck.end: (20.0, 20.0)}))
    assert (len(found.borders) < len(traced.borders)) is goes


@pytest.mark.parametrize("seed", range(6))
def test_nodes_become_one_in_pairs_and_have_no_more_borders_than_a_file_can_hold(seed: int) -> None:
    """In a map of many regions, all of whose nodes are in one place: whatever is short enough goes."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[: 3 * SIDE, : 3 * SIDE]
    middles = rng.uniform(0, 3 * SIDE, (60, 2))
    nearest = np.hypot(y[..., None] - middles[:, 0], x[..., None] - middles[:, 1]).argmin(axis=-1)
    traced = of_labels(connected_components(nearest.astype(np.int32)))
    found, _ = without_shortest(traced, replace(traced, nodes=np.zeros_like(traced.nodes)))
    n_gone = len(traced.borders) - len(found.borders)
    assert n_gone > 0
    assert len(found.nodes) == len(traced.nodes) - n_gone
    ends = Counter(node for b in found.borders if not b.closed for node in (b.start, b.end))
    assert 3 < max(ends.values()) <= 4 + 4 - 2 <= MOST_AT_NODE
    assert min(len(loop) for region in found.loops for loop in region) > 1
    assert_whole(found)


def test_a_single_pixel_that_hangs_by_its_corner_stays() -> None:
    """The shortest border there is that comes back to its node: four cracks."""
    labels = np.zeros((SIDE, SIDE), np.int32)
    labels[10:20, 10:20] = 1
    labels[20, 20] = 2
    traced = of_labels(labels)
    around = traced.borders[between(traced, 0, 2)]
    assert around.start == around.end >= 0
    assert len(around.samples) == 6 > MOST_SAMPLES
    assert without_shortest(traced, replace(traced, nodes=np.zeros_like(traced.nodes)))[0] is traced


def test_short_borders_along_the_frame_stay() -> None:
    """The frame goes on beside them."""
    labels = np.zeros((SIDE, SIDE), np.int32)
    labels[:20, 10:12] = 1
    traced = of_labels(labels)
    lengths = [len(border.samples) for border in traced.borders if border.on_frame]
    assert min(lengths) <= MOST_SAMPLES
    assert without_shortest(traced, replace(traced, nodes=np.zeros_like(traced.nodes)))[0] is traced
