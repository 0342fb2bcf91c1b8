"""Borders of label maps: hand-drawn cases, and what holds for any map."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcvec.borders.planar_graph import OUTSIDE, PlanarGraph, planar_graph
from gcvec.regions.components import connected_components

Crack = tuple[tuple[int, int], tuple[int, int]]


def drawn(text: str) -> np.ndarray:
    """Label map from rows of letters; components are numbered in raster order."""
    rows = [[ord(c) for c in row] for row in text.split()]
    return connected_components(np.array(rows, np.int32))


def sides(labels: np.ndarray) -> dict[Crack, tuple[int, int]]:
    """Every directed crack between different labels, and the labels at its left and right hand."""
    padded = np.pad(labels, 1, constant_values=OUTSIDE)
    height, width = labels.shape
    found: dict[Crack, tuple[int, int]] = {}
    for y in range(height + 1):
        for x in range(width + 1):
            above, below = int(padded[y, x + 1]), int(padded[y + 1, x + 1])
            if x < width and above != below:
                found[(x, y), (x + 1, y)] = (above, below)
            west, east = int(padded[y + 1, x]), int(padded[y + 1, x + 1])
            if y < height and west != east:
                found[(x, y), (x, y + 1)] = (east, west)
    return found


def walked(graph: PlanarGraph, arc: int, forward: bool) -> np.ndarray:
    points = graph.arcs[arc].points
    return points if forward else points[::-1]


def loop_areas(graph: PlanarGraph, region: int) -> list[float]:
    areas = []
    for loop in graph.loops[region]:
        ring = np.concatenate([walked(graph, arc, forward)[:-1] for arc, forward in loop]).astype(float)
        x, y = ring.T
        areas.append(float((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2))
    return sorted(areas)


def test_one_region_is_bounded_by_the_four_sides_of_the_frame() -> None:
    graph = planar_graph(np.zeros((3, 5), np.int32))
    assert sorted(map(tuple, graph.nodes.tolist())) == [(0, 0), (0, 3), (5, 0), (5, 3)]
    assert len(graph.arcs) == 4
    assert {(a.left, a.right) for a in graph.arcs} <= {(OUTSIDE, 0), (0, OUTSIDE)}
    assert [len(loop) for loop in graph.loops[0]] == [4]
    assert loop_areas(graph, 0) == [15]


def test_border_that_reaches_the_frame_ends_in_junctions() -> None:
    graph = planar_graph(drawn("aab aab aab"))
    assert {(2, 0), (2, 3)} <= set(map(tuple, graph.nodes.tolist()))
    (arc,) = [a for a in graph.arcs if OUTSIDE not in (a.left, a.right)]
    assert sorted(arc.points.tolist()) == [[2, 0], [2, 1], [2, 2], [2, 3]]
    downwards = arc.points[0, 1] == 0
    assert (arc.left, arc.right) == ((1, 0) if downwards else (0, 1))


def test_island_is_one_closed_arc_without_a_node() -> None:
    graph = planar_graph(drawn("aaaa abba aaaa"))
    (arc,) = [a for a in graph.arcs if a.closed]
    assert len(arc.points) == 7
    assert (arc.points[0] == arc.points[-1]).all()
    assert loop_areas(graph, 0) == [-2, 12]
    assert loop_areas(graph, 1) == [2]


def test_ring_has_an_outer_loop_and_a_hole() -> None:
    graph = planar_graph(drawn("aaaaa abbba abcba abbba aaaaa"))
    assert loop_areas(graph, 1) == [-1, 9]
    assert [a.closed for a in graph.arcs].count(True) == 2


def test_diagonal_crossing_is_a_node_where_regions_keep_to_their_pixels() -> None:
    graph = planar_graph(drawn("aaaa abaa aaca aaaa"))
    assert (2, 2) in set(map(tuple, graph.nodes.tolist()))
    assert loop_areas(graph, 1) == [1]
    assert loop_areas(graph, 2) == [1]
    assert sum(loop_areas(graph, 0)) == 14


def test_region_that_touches_itself_at_a_crossing() -> None:
    graph = planar_graph(drawn("abb bab bbb"))
    middle = 2
    assert loop_areas(graph, 0) == [1]
    assert loop_areas(graph, middle) == [1]
    assert sum(loop_areas(graph, 1)) == 7


maps = given(
    owners=st.integers(1, 9).flatmap(
        lambda h: st.integers(1, 9).flatmap(
            lambda w: arrays(np.int32, (h, w), elements=st.integers(0, 3), fill=st.nothing())
        )
    )
)


@settings(max_examples=150)
@maps
def test_every_crack_lies_in_one_arc_with_the_right_sides(owners: np.ndarray) -> None:
    labels = connected_components(owners)
    graph = planar_graph(labels)
    truth = sides(labels)
    seen: Counter[Crack] = Counter()
    for arc in graph.arcs:
        points = [tuple(p) for p in arc.points.tolist()]
        for a, b in pairwise(points):
            crack, forward = ((a, b), True) if (a, b) in truth else ((b, a), False)
            seen[crack] += 1
            left, right = truth[crack]
            assert (arc.left, arc.right) == ((left, right) if forward else (right, left))
    assert seen == Counter(truth.keys())


@settings(max_examples=150)
@maps
def test_loops_bound_their_regions(owners: np.ndarray) -> None:
    labels = connected_components(owners)
    graph = planar_graph(labels)
    used: Counter[tuple[int, bool]] = Counter()
    for region, loops in enumerate(graph.loops):
        areas = loop_areas(graph, region)
        assert sum(areas) == (labels == region).sum()
        assert sum(area > 0 for area in areas) == 1
        for loop in loops:
            used.update(loop)
            for (a, a_forward), (b, b_forward) in zip(loop, loop[1:] + loop[:1], strict=True):
                end = walked(graph, a, a_forward)[-1]
                assert (end == walked(graph, b, b_forward)[0]).all()
            for a, forward in loop:
                assert region == (graph.arcs[a].right if forward else graph.arcs[a].left)
    expected = {(a, f) for a, arc in enumerate(graph.arcs) for f in (True, False)}
    outer = {(a, f) for a, f in expected if (graph.arcs[a].right if f else graph.arcs[a].left) == OUTSIDE}
    assert used == Counter(expected - outer)


@settings(max_examples=80)
@maps
def test_nodes_are_where_arcs_meet(owners: np.ndarray) -> None:
    graph = planar_graph(connected_components(owners))
    nodes = set(map(tuple, graph.nodes.tolist()))
    for arc in graph.arcs:
        inner = set(map(tuple, arc.points[1:-1].tolist()))
        assert not inner & nodes
        if not arc.closed:
            assert tuple(arc.points[0]) == tuple(graph.nodes[arc.start])
            assert tuple(arc.points[-1]) == tuple(graph.nodes[arc.end])
