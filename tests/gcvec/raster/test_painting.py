"""Box filtering against a slow supersampled twin."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gcvec.patches.canonical import lay_unfolded_canvas
from gcvec.raster.painting import paint, sample
from tests.gcvec.scenes import foundation_of, some_points

TRIANGLE = np.array([[0, 1, 2]])


def painted_slowly(corners: np.ndarray, colors: np.ndarray, width: int, height: int, n: int) -> np.ndarray:
    """Mean over n x n samples a pixel of the triangle's colour, 0 outside."""
    y, x = np.mgrid[: height * n, : width * n]
    p = np.stack([x.ravel() + 0.5, y.ravel() + 0.5], axis=1) / n
    weights = np.linalg.solve(np.vstack([corners.T, np.ones(3)]), np.vstack([p.T, np.ones(len(p))]))
    values = np.where((weights >= 0).all(axis=0)[:, None], weights.T @ colors, 0.0)
    return values.reshape(height, n, width, n, -1).mean(axis=(1, 3))


@settings(max_examples=30)
@given(
    corners=st.tuples(*[st.tuples(st.floats(-3, 9), st.floats(-3, 8))] * 3).map(np.array),
    seed=st.integers(0, 1000),
)
def test_pixels_are_averages_over_their_squares(corners: np.ndarray, seed: int) -> None:
    (ux, uy), (vx, vy) = corners[1] - corners[0], corners[2] - corners[0]
    area = ux * vy - uy * vx
    assume(abs(area) >= 0.5)
    corners = corners if area > 0 else corners[::-1]
    colors = np.random.default_rng(seed).uniform(0, 1, (3, 3))
    ours = paint(corners, TRIANGLE, colors, TRIANGLE, 6, 5)
    slow = painted_slowly(corners, colors, 6, 5, 40)
    # Each border sample is right or wrong by 1 / 40^2, and a line meets at most about 2 * 40 of a pixel's.
    assert np.abs(ours - slow).max() < 0.05
    assert np.abs(ours - slow).mean() < 0.005


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


def test_what_is_no_more_than_a_line_holds_no_pixel() -> None:
    corners = np.array([[0.0, 0.0], [4.0, 0.0], [0.0, 4.0], [2.0, 2.0]])
    triangles = np.array([[0, 1, 2], [0, 3, 3]])  # the second lies along centres of the first's pixels
    picture = sample(corners, triangles, corners, triangles, 2, 2)
    y, x = np.mgrid[:2, :2] + 0.5
    np.testing.assert_allclose(picture, np.stack([x, y], axis=-1), atol=1e-12)
