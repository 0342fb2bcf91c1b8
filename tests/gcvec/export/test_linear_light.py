"""Colours in linear light, and triangles so small that it does not matter which light they are mixed in."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcvec.export.linear_light import SHORTEST, TOLERANCE, linear_light, srgb, subdivided
from gcvec.export.triangles import Triangles
from tests.gcvec.areas import areas


@pytest.mark.parametrize(
    ("encoded", "light"), [(0.0, 0.0), (0.04045, 0.0031308), (0.5, 0.2140411), (0.735357, 0.5), (1.0, 1.0)]
)
def test_colours_are_those_of_the_standard(encoded: float, light: float) -> None:
    assert linear_light(np.array(encoded)) == pytest.approx(light, abs=1e-6)
    assert srgb(np.array(light)) == pytest.approx(encoded, abs=1e-6)


def test_there_and_back() -> None:
    levels = np.linspace(0, 1, 1001)
    np.testing.assert_allclose(srgb(linear_light(levels)), levels, atol=1e-6)
    assert (np.diff(linear_light(levels)) > 0).all()


def fan(colors: np.ndarray, size: float) -> Triangles:
    """Four triangles around the middle of a square."""
    positions = size * np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5]])
    corners = np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])
    return Triangles(positions, colors, corners, np.arange(5))


colorings = st.lists(st.lists(st.floats(0, 1), min_size=3, max_size=3), min_size=5, max_size=5).map(np.array)


@settings(max_examples=20)
@given(colorings)
def test_pieces_show_the_same_picture(colors: np.ndarray) -> None:
    """They tile their triangles, turned as these were, and mix the same colours as they are encoded."""
    whole = fan(colors, 24.0)
    fine = subdivided(whole)
    area = areas(fine.positions, fine.corners)
    assert (area > 0).all()
    assert area.sum() == pytest.approx(24.0**2)
    middle = fine.positions[fine.corners].mean(axis=1)
    color = fine.colors[fine.corners].mean(axis=1)
    seen = 0
    for own in whole.corners:
        to_weights = np.linalg.inv(np.vstack([whole.positions[own].T, np.ones(3)]))
        weight = np.column_stack([middle, np.ones(len(middle))]) @ to_weights.T
        inside = (weight > 0).all(axis=1)
        np.testing.assert_allclose(color[inside], weight[inside] @ whole.colors[own], atol=1e-9)
        seen += inside.sum()
    assert seen == len(middle)


@settings(max_examples=20)
@given(colorings)
def test_along_edges_it_hardly_matters_which_light_colours_are_mixed_in(colors: np.ndarray) -> None:
    """Unless they are short."""
    fine = subdivided(fan(colors, 24.0))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        start, end = fine.corners[:, a], fine.corners[:, b]
        long = np.hypot(*(fine.positions[end] - fine.positions[start]).T) > SHORTEST
        for t in (0.25, 0.5, 0.75):
            mixed = (1 - t) * fine.colors[start] + t * fine.colors[end]
            light = (1 - t) * linear_light(fine.colors[start]) + t * linear_light(fine.colors[end])
            assert np.abs(srgb(light) - mixed)[long].max(initial=0) <= TOLERANCE + 1e-12


@settings(max_examples=20)
@given(colorings)
def test_no_crack_opens(colors: np.ndarray) -> None:
    """No vertex lies inside an edge: every edge off the square's outline has a triangle on both sides."""
    fine = subdivided(fan(colors, 24.0))
    edges = np.stack([fine.corners, np.roll(fine.corners, -1, axis=1)], axis=2).reshape(-1, 2)
    ways = {(tuple(fine.positions[a]), tuple(fine.positions[b])) for a, b in edges}
    for a, b in ways:
        on_outline = any(a[k] == b[k] and a[k] in (0.0, 24.0) for k in (0, 1))
        assert ((b, a) in ways) != on_outline


def test_an_edge_between_two_colourings_is_cut_for_both() -> None:
    """On a hard edge: one side is of one colour and would need no cut, the other runs from black to white."""
    positions = np.array([[0.0, 0], [0, 32], [16, 16], [0, 0], [0, 32], [-16, 16]])
    grey = np.array([0, 1, 0, 0.5, 0.5, 0.5])
    corners = np.array([[0, 2, 1], [3, 4, 5]])
    two = Triangles(positions, np.repeat(grey[:, None], 3, axis=1), corners, np.array([0, 1, 2, 0, 1, 3]))
    fine = subdivided(two)
    sides = [
        {
            tuple(fine.positions[v])
            for triangle in fine.corners
            for v in triangle
            if fine.positions[v, 0] == 0 and (fine.colors[triangle] == 0.5).all() == flat
        }
        for flat in (False, True)
    ]
    assert sides[0] == sides[1]
    assert len(sides[0]) > 4


def test_places_tell_which_vertices_are_at_the_same_position() -> None:
    colors = np.array([[0, 0, 0], [1, 1, 1], [0, 1, 0], [1, 0, 1], [0.2, 0.8, 0.5]], float)
    fine = subdivided(fan(colors, 24.0))
    by_place = {place: fine.positions[fine.places == place] for place in set(fine.places.tolist())}
    assert all((same == same[0]).all() for same in by_place.values())
    assert len({tuple(same[0]) for same in by_place.values()}) == len(by_place)


def test_even_and_small_triangles_stay_whole() -> None:
    even, loud = np.full((5, 3), 0.3), np.eye(5, 3)
    assert len(subdivided(fan(even, 1000.0)).corners) == 4
    assert len(subdivided(fan(loud, SHORTEST)).corners) == 4
