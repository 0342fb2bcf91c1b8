"""Box filtering against a slow supersampled twin; whole pictures covered exactly once."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcvec.canonical import lay_unfolded_canvas
from gcvec.drawing import FLATNESS
from gcvec.raster import Coverage, paint, sample, triangle_at_pixel_centres
from tests.gcvec.scenes import SCENES, foundation_of, some_points

TRIANGLE = np.array([[0, 1, 2]])


def painted_slowly(corners: np.ndarray, colors: np.ndarray, width: int, height: int, n: int) -> np.ndarray:
    """Mean over n x n samples a pixel of the triangle's colour, 0 outside."""
    y, x = np.mgrid[: height * n, : width * n]
    p = np.stack([x.ravel() + 0.5, y.ravel() + 0.5], axis=1) / n
    weights = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), np.vstack([p.T, np.ones(len(p))]))
    values = np.where((weights >= 0).all(axis=0)[:, None], weights.T @ colors, 0.0)
    return values.reshape(height, n, width, n, -1).mean(axis=(1, 3))


@settings(deadline=None, max_examples=30)
@given(
    corners=st.tuples(*[st.tuples(st.floats(-3, 9), st.floats(-3, 8))] * 3).map(np.array),
    seed=st.integers(0, 1000),
)
def test_pixels_are_averages_over_their_squares(corners: np.ndarray, seed: int) -> None:
    (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
    area = ux * vy - uy * vx
    if abs(area) < 0.5:
        return
    corners = corners if area > 0 else corners[::-1]
    colors = np.random.default_rng(seed).uniform(0, 1, (3, 3))
    ours = paint(corners, TRIANGLE, colors, TRIANGLE, 6, 5)
    slow = painted_slowly(corners, colors, 6, 5, 40)
    # Each border sample is right or wrong by 1 / 40^2, and a line meets at most about 2 * 40 of a pixel's.
    assert np.abs(ours - slow).max() < 0.05
    assert np.abs(ours - slow).mean() < 0.005


@settings(deadline=None, max_examples=60)
@given(corners=st.tuples(*[st.tuples(st.floats(0, 7), st.floats(0, 7))] * 3).map(np.array))
def test_areas_add_up_to_the_triangle(corners: np.ndarray) -> None:
    (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
    area = ux * vy - uy * vx
    coverage = Coverage(corners if area > 0 else corners[::-1], TRIANGLE, 7, 7)
    if abs(area) > 1e-9:
        assert coverage.weights[coverage.entries()].sum() == pytest.approx(abs(area) / 2, rel=1e-9)


def test_linear_functions_are_reproduced_exactly() -> None:
    """The mean of a linear function over a pixel is its value at the centre, whatever triangles tile it."""
    foundation = foundation_of("voronoi")
    canvas = lay_unfolded_canvas(foundation, some_points(foundation, 30))[0]
    drawing = canvas.drawing()
    height, width = foundation.network.height, foundation.network.width
    values = np.column_stack([drawing.image @ [0.3, -0.7] + 2.0, drawing.image])
    picture = paint(drawing.image, drawing.triangles, values, drawing.triangles, width, height)
    y, x = np.mgrid[:height, :width] + 0.5
    np.testing.assert_allclose(picture, np.stack([0.3 * x - 0.7 * y + 2, x, y], axis=-1), atol=1e-9)
    raw = sample(drawing.image, drawing.triangles, values, drawing.triangles, width, height)
    np.testing.assert_allclose(raw, picture, atol=1e-9)


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
