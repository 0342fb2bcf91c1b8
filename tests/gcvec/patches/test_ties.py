"""Meshes of samples on circles do not depend on the order in which they were triangulated."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from gcvec.patches.triangulation import patch_triangulation
from tests.gcvec.areas import areas

CIRCLE = sorted(
    {(s * x, t * y) for x, y in [(5, 0), (4, 3), (3, 4), (0, 5)] for s in (1, -1) for t in (1, -1)},
    key=lambda p: np.arctan2(p[1], p[0]),
)
"""The 12 points of the lattice at a distance of 5 from the origin."""


def triangles_of(vertices: np.ndarray, ring: np.ndarray, height: int = 40) -> set[tuple[int, ...]]:
    """The mesh of one patch, each triangle from its lowest vertex on."""
    segments = np.stack([ring, np.roll(ring, -1)], axis=1)
    sides = np.tile([0, -1], (len(ring), 1))
    triangles, patch = patch_triangulation(np.asarray(vertices, float), segments, sides, height)
    assert (patch == 0).all()
    assert areas(np.asarray(vertices, float), triangles).min() > 0
    return {tuple(np.roll(t, -int(np.argmin(t))).tolist()) for t in triangles}


def fan(ring: list[int]) -> set[tuple[int, ...]]:
    """The fan of the lowest vertex of a polygon."""
    first = ring.index(min(ring))
    start, *others = ring[first:] + ring[:first]
    return {(start, a, b) for a, b in zip(others, others[1:], strict=False)}


@given(st.permutations(range(12)), st.sampled_from([1.0, 0.1, 1 / 3]), st.sampled_from([0.0, 4000.0]))
def test_a_polygon_on_a_circle_is_the_fan_of_its_lowest_vertex(
    ring: list[int], size: float, shift: float
) -> None:
    """Exactly on it, or but for rounding."""
    vertices = np.empty((12, 2))
    vertices[ring] = size * np.array(CIRCLE) + 20 + shift
    assert triangles_of(vertices, np.array(ring), 4040) == fan(ring)


@given(st.permutations(range(14)))
def test_of_a_strip_every_rectangle_has_a_fan_of_its_own(number: list[int]) -> None:
    """Seven rungs: neighbours touch, but do not lie on one circle."""
    below, above = number[:7], number[7:]
    vertices = np.empty((14, 2))
    vertices[below] = [(3.0 * i, 5) for i in range(7)]
    vertices[above] = [(3.0 * i, 9) for i in range(7)]
    expected = set[tuple[int, ...]]()
    for i in range(6):
        expected |= fan([below[i], below[i + 1], above[i + 1], above[i]])
    assert triangles_of(vertices, np.array(below + above[::-1])) == expected


def test_a_constraint_is_no_tie() -> None:
    """Two patches share a diagonal of a square; the fan of vertex 0 would cross it."""
    vertices = np.array([[0, 0], [8, 0], [8, 8], [0, 8.0]])
    segments = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [1, 3]])
    sides = np.array([[0, -1], [1, -1], [1, -1], [0, -1], [1, 0]])
    triangles, patch = patch_triangulation(vertices, segments, sides, 8)
    assert {frozenset(t) for t in triangles.tolist()} == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}
    assert sorted(patch.tolist()) == [0, 1]


def test_where_there_is_no_tie_delaunay_decides() -> None:
    """One corner of a square moved out of the circle of the others, or into it."""
    for shift, diagonal in ((-1e-6, {0, 2}), (1e-6, {1, 3})):
        vertices = np.array([[0, 0], [8, 0], [8, 8], [shift, 8 - shift]])
        found = triangles_of(vertices, np.arange(4), 8)
        assert all(diagonal <= set(triangle) for triangle in found)


def test_points_within_the_circle_leave_no_tie() -> None:
    points = np.random.default_rng(0).uniform(-2, 2, (5, 2))
    vertices = np.concatenate([CIRCLE, points]) + 20
    found = {frozenset(triangle) for triangle in triangles_of(vertices, np.arange(12))}
    assert found == {frozenset(triangle) for triangle in Delaunay(vertices).simplices.tolist()}


@pytest.mark.parametrize("far", [1e3, 8e3])
def test_many_samples_on_one_circle(far: float) -> None:
    n = 3000
    turn = 2 * np.pi * np.arange(n) / n
    vertices = far * np.array([1.5, 1.5]) + far * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    assert len(triangles_of(vertices, np.arange(n), int(4 * far))) == n - 2
