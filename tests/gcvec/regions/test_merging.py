"""Rounds of merging, against numpy and scipy."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.regions.components import SLIVER_AREA
from gcvec.regions.merging import (
    adjacency_graph,
    border_gains,
    merged,
    summed,
    weakest_of_smaller,
)


def cracks(n: int, regions: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    origin, target = rng.integers(0, regions, (2, n))
    return origin, target, rng.normal(0, 2, (n, 3))


@pytest.mark.parametrize("seed", [0, 1])
def test_borders_are_summed_by_pairs(seed: int) -> None:
    origin, target, step = cracks(300, 9, seed)
    length, energy = np.random.default_rng(seed).random((2, 300))
    first, second, lengths, energies, steps = summed(origin, target, length, energy, step, 9)
    pairs = sorted({(min(a, b), max(a, b)) for a, b in zip(origin, target, strict=True) if a != b})
    assert list(zip(first, second, strict=True)) == pairs
    for k, (a, b) in enumerate(pairs):
        forward, backward = (origin == a) & (target == b), (origin == b) & (target == a)
        assert lengths[k] == pytest.approx(length[forward | backward].sum())
        assert energies[k] == pytest.approx(energy[forward | backward].sum())
        np.testing.assert_allclose(steps[k], step[forward].sum(axis=0) - step[backward].sum(axis=0))


def test_gains_as_read_out_loud() -> None:
    graph = adjacency_graph(*cracks(200, 8, 2))
    areas = np.array([5, 20, 20, 300, 1000, 12, 90, 4000])
    smaller, gain = border_gains(graph.first, graph.second, graph.length, graph.energy, graph.step, areas)
    for k in range(len(graph)):
        a, b = graph.first[k], graph.second[k]
        assert smaller[k] == (b if areas[b] < areas[a] else a)
        mean = graph.step[k] / graph.length[k]
        worth = (graph.energy[k] / graph.length[k] + (mean**2).mean()) / 2
        small = areas[smaller[k]]
        cost = 1 - 3 / graph.length[k] + 100 / small
        assert gain[k] == pytest.approx(worth - cost - 1000 * (small < SLIVER_AREA))
    chosen = weakest_of_smaller(graph.first, graph.second, smaller, gain, 8)
    assert len(np.unique(smaller[chosen])) == len(chosen)
    for region in range(8):
        own = np.flatnonzero((graph.first == region) | (graph.second == region))
        weakest = own[gain[own].argmin()]
        assert (weakest in chosen) == (smaller[weakest] == region or weakest in chosen)
        assert not any(smaller[k] == region for k in chosen if k != weakest)


def test_merging_ends_where_every_border_pays() -> None:
    """Three regions in a row: a faint border between the first two, a strong one to the third."""
    origin, target = np.repeat([0, 1], 30), np.repeat([1, 2], 30)
    step = np.repeat([[0.1] * 3, [3.0] * 3], 30, axis=0)
    groups = merged(adjacency_graph(origin, target, step), np.array([900, 900, 900]))
    assert groups.tolist() == [0, 0, 1]
    assert merged(adjacency_graph(origin, target, step), np.array([900] * 3), 1).tolist() == [0, 0, 0]
    assert merged(adjacency_graph(origin, target, step), np.array([900] * 3), 3).tolist() == [0, 1, 2]


def test_groups_with_too_much_to_hold_stay_apart() -> None:
    """Five regions in a row without any step between them; the last one is light enough for any group."""
    origin, target = np.repeat([0, 1, 2, 3], 30), np.repeat([1, 2, 3, 4], 30)
    faint = adjacency_graph(origin, target, np.full((120, 3), 0.01))
    load = np.array([10.0, 10.0, 10.0, 10.0, 1.0])
    areas = np.array([900] * 5)
    assert merged(faint, areas).tolist() == [0] * 5
    groups = merged(faint, areas, load=load, most_load=20.0)
    assert np.bincount(groups, load).max() <= 21
    assert groups.max() + 1 == 2
    assert merged(faint, areas, load=load, most_load=10.0).max() + 1 == 4


def test_a_bridge_of_a_crack_or_two_joins_nothing() -> None:
    """Two regions of one colour: they stay apart where they meet at a corner, unless one of them is small."""
    origin, target = np.zeros(30, np.int64), np.ones(30, np.int64)
    same = np.full((30, 3), 0.01)
    for cracks, areas, groups in (
        (2, [900, 900], [0, 1]),
        (2, [900, 90], [0, 0]),
        (8, [900, 900], [0, 0]),
    ):
        graph = adjacency_graph(origin[:cracks], target[:cracks], same[:cracks])
        assert merged(graph, np.array(areas)).tolist() == groups


def test_no_sliver_is_left_however_many_regions_are_wanted() -> None:
    """Five regions in a row, all of them clear; the second and the third are slivers."""
    origin, target = np.repeat([0, 1, 2, 3], 9), np.repeat([1, 2, 3, 4], 9)
    clear = np.repeat([[9.0] * 3, [1.0] * 3, [9.0] * 3, [9.0] * 3], 9, axis=0)
    graph = adjacency_graph(origin, target, clear)
    areas = np.array([900, SLIVER_AREA // 2, SLIVER_AREA // 2, 900, 900])
    for wanted in (4, 5, 9):
        assert merged(graph, areas, wanted).tolist() == [0, 1, 1, 2, 3]
    areas[2] -= 1
    for wanted in (4, 5, 9):
        assert merged(graph, areas, wanted).max() == 2
    assert merged(graph, areas, 2).max() == 1


def test_no_more_border_is_left_than_wanted() -> None:
    """Four regions in a row: the weakest borders go, though each pays, until the rest is short enough."""
    origin, target = np.repeat([0, 1, 2], 30), np.repeat([1, 2, 3], 30)
    clear = np.repeat([[1.9] * 3, [1.7] * 3, [1.8] * 3], 30, axis=0)
    graph = adjacency_graph(origin, target, clear)
    for most, groups in ((90, [0, 1, 2, 3]), (89, [0, 1, 1, 2]), (59, [0, 1, 1, 1]), (0, [0, 0, 0, 0])):
        assert merged(graph, np.array([900] * 4), most_border=most).tolist() == groups


def test_what_belongs_to_a_full_group_does_not_cross_an_edge() -> None:
    """A crumb, 20 px², with no step towards a group that is full, and an edge towards one that is not."""
    origin, target = np.repeat([0, 1, 0], [8, 8, 30]), np.repeat([1, 2, 2], [8, 8, 30])
    step = np.repeat([[0.01] * 3, [2.0] * 3, [2.0] * 3], [8, 8, 30], axis=0)
    graph, areas = adjacency_graph(origin, target, step), np.array([9000, 20, 900])
    assert merged(graph, areas).tolist() == [0, 0, 1]
    load = np.array([50.0, 1.0, 5.0])
    assert merged(graph, areas, load=load, most_load=20.0).tolist() == [0, 0, 1]
