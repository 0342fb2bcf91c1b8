"""Whole pictures are covered exactly once, and triangles as far as their areas go."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcvec.patches.canonical import lay_unfolded_canvas
from gcvec.patches.drawing import FLATNESS
from gcvec.raster.coverage import Coverage
from gcvec.raster.covering import most_entries_of
from gcvec.raster.painting import paint, triangle_at_pixel_centres
from tests.gcvec.scenes import SCENES, foundation_of, some_points

TRIANGLE = np.array([[0, 1, 2]])


@settings(max_examples=60)
@given(corners=st.tuples(*[st.tuples(st.floats(0, 7), st.floats(0, 7))] * 3).map(np.array))
def test_areas_add_up_to_the_triangle(corners: np.ndarray) -> None:
    (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
    area = ux * vy - uy * vx
    coverage = Coverage(corners if area > 0 else corners[::-1], TRIANGLE, 7, 7)
    if abs(area) > 1e-9:
        assert coverage.weights[coverage.entries()].sum() == pytest.approx(abs(area) / 2, rel=1e-9)


@settings(max_examples=200)
@given(
    place=st.tuples(st.floats(-20, 16_384), st.floats(-20, 30)).map(np.array),
    shape=st.tuples(*[st.tuples(st.floats(-12, 12), st.floats(-12, 12))] * 3).map(np.array),
    whole=st.booleans(),
)
def test_a_triangle_anywhere_has_no_more_entries_than_there_is_room_for(
    place: np.ndarray, shape: np.ndarray, whole: bool
) -> None:
    """And its weights are its area's within the picture, with the centroid that clipping finds."""
    width, height = 16_384, 30
    corners = place + shape
    corners = np.round(corners) if whole else corners
    (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
    coverage = Coverage(corners, TRIANGLE, width, height)
    own = coverage.entries()
    assert len(own) <= most_entries_of(corners, TRIANGLE, width, height)
    assert (np.diff(coverage.pixel[own]) > 0).all()
    inside = clipped(corners, width, height)
    area, centroid = area_and_centroid(inside)
    sign = np.sign(ux * vy - uy * vx)
    weights = coverage.weights[own]
    assert weights.sum() == pytest.approx(sign * area, abs=1e-8)
    if area > 1e-3:
        np.testing.assert_allclose(weights.sum(axis=0) @ corners / (sign * area), centroid, rtol=1e-6)


def clipped(polygon: np.ndarray, width: int, height: int) -> np.ndarray:
    """The part of a convex polygon `(n, 2)` inside the picture (Sutherland and Hodgman 1974)."""
    for axis, bound, side in ((0, 0, 1), (0, width, -1), (1, 0, 1), (1, height, -1)):
        kept = []
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            da, db = side * (a[axis] - bound), side * (b[axis] - bound)
            if da >= 0:
                kept.append(a)
            if min(da, db) < 0 < max(da, db):
                kept.append(a + (b - a) * da / (da - db))
        polygon = np.array(kept).reshape(-1, 2)
    return polygon


def area_and_centroid(polygon: np.ndarray) -> tuple[float, np.ndarray]:
    """Of a convex polygon `(n, 2)`, by a fan of triangles."""
    if len(polygon) < 3:
        return 0.0, np.zeros(2)
    u, v = polygon[1:-1] - polygon[0], polygon[2:] - polygon[0]
    twice = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    centroid = polygon[0] + (twice[:, None] * (u + v)).sum(axis=0) / (3 * twice.sum() or 1.0)
    return abs(twice.sum()) / 2, centroid


@pytest.mark.parametrize("scale", [1.0, 2.0, 3.7])
@pytest.mark.parametrize("scene", SCENES)
def test_every_pixel_is_covered_exactly_once(scene: str, scale: float) -> None:
    foundation = foundation_of(scene)
    network = foundation.network
    canvas = lay_unfolded_canvas(foundation, some_points(foundation, 25))[0]
    drawing = canvas.drawing(FLATNESS / scale)
    width, height = (max(1, round(n * scale)) for n in (network.width, network.height))
    vertices = drawing.image * [width / network.width, height / network.height]
    coverage = Coverage(vertices, drawing.triangles, width, height)
    own = coverage.entries()
    area = np.bincount(coverage.pixel[own], coverage.weights[own].sum(axis=1), minlength=width * height)
    np.testing.assert_allclose(area, 1, atol=1e-9)
    corners = vertices[drawing.triangles]
    (ux, uy), (vx, vy) = (corners[:, 1] - corners[:, 0]).T, (corners[:, 2] - corners[:, 0]).T
    assert (ux * vy - uy * vx).min() > 0
    # Positive areas that sum to 1 in each pixel: no gap and no overlap.
    assert triangle_at_pixel_centres(vertices, drawing.triangles, width, height).min() >= 0


def test_coverage_matrix_paints_the_same_picture() -> None:
    foundation = foundation_of("ring")
    canvas = lay_unfolded_canvas(foundation, some_points(foundation, 40))[0]
    drawing = canvas.drawing()
    operator, corner_color = canvas.operator(drawing)
    colors = operator @ np.random.default_rng(1).uniform(0, 1, (operator.shape[1], 3))
    width, height = foundation.network.width, foundation.network.height
    matrix = canvas.coverage(drawing).matrix(corner_color, len(colors))
    painted = paint(drawing.image, drawing.triangles, colors, corner_color, width, height)
    np.testing.assert_allclose((matrix @ colors).reshape(height, width, 3), painted, atol=1e-12)


def test_what_lies_outside_the_picture_is_left_out() -> None:
    corners = np.array([(-50.0, -50), (100, -50), (-50, 100)])
    coverage = Coverage(corners, TRIANGLE, 4, 3)
    own = coverage.entries()
    area = np.bincount(coverage.pixel[own], coverage.weights[own].sum(axis=1), minlength=12)
    np.testing.assert_allclose(area, 1, atol=1e-12)
    assert len(Coverage(corners - 500, TRIANGLE, 4, 3).entries()) == 0
