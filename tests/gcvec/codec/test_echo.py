"""Colours that are rounded so that they make up for each other in the picture."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from skimage import data

from gcvec import Options, VectorImage, vectorize
from gcvec.codec.echo import add_to, echo_of, make_up, silence
from gcvec.codec.file import decode, encode_rounded, rounded_colors
from gcvec.colors.color_fit import ColorFit, color_fit

Floats = NDArray[np.float64]

STEP = 1 / 64


@cache
def case() -> tuple[VectorImage, ColorFit]:
    """A picture whose colours are not rounded yet, and the fit that shows them."""
    pixels = np.ascontiguousarray(data.astronaut()[:90, 150:270])
    image = vectorize(pixels, None, Options(target_mse=5))
    rng = np.random.default_rng(0)
    exact = replace(
        image,
        boundary_colors=image.boundary_colors + rng.uniform(-0.02, 0.02, image.boundary_colors.shape),
        point_colors=image.point_colors + rng.uniform(-0.02, 0.02, image.point_colors.shape),
    ).knowing(image.canvas)
    coverage = image.canvas.coverage(image.canvas.unit[0], np.float32)
    truth = np.zeros((pixels.size // 3, 3), np.float32)
    return exact, color_fit(image.canvas, coverage, truth)


def off(boundary: Floats, points: Floats) -> Floats:
    """What the picture `(p, 3)` is off by with these colours."""
    image, fit = case()
    wanted = np.concatenate([image.boundary_colors, image.point_colors])
    return np.asarray(fit.design @ (fit.operator @ (np.concatenate([boundary, points]) - wanted)))


def test_the_picture_is_off_by_less() -> None:
    """Than with colours that are rounded each for itself."""
    image, fit = case()
    alone, together = off(*rounded_colors(image)), off(*rounded_colors(image, fit))
    assert (together**2).sum() < 0.93 * (alone**2).sum()


def test_a_file_holds_the_colors_that_were_foreseen() -> None:
    image, fit = case()
    file, boundary, points = encode_rounded(image, fit)
    for found, expected in zip(rounded_colors(image, fit), (boundary, points), strict=True):
        np.testing.assert_array_equal(found, expected)
    np.testing.assert_allclose(decode(file).point_colors, points, atol=1e-12)


def test_a_point_makes_up_for_what_it_can() -> None:
    """The least squares answer of one colour to the error of all others, from the matrices themselves."""
    image, fit = case()
    boundary, n = np.random.default_rng(1).normal(0, 0.02, image.boundary_colors.shape), len(image.points)
    echo = echo_of(fit, boundary, n, STEP)
    given = (fit.design @ fit.operator).tocsc()
    basis = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])
    error = given @ np.concatenate([boundary, np.zeros((n, 3))]) @ basis.T / STEP
    np.testing.assert_allclose(echo.error, error, atol=1e-4)
    moved = 0.0
    for i in range(0, n, 97):
        own = given[:, [len(boundary) + i]].toarray()[:, 0]
        expected = -(own @ error) / (own @ own)
        moved = max(moved, float(np.abs(expected).max()))
        wish = np.zeros(3)
        make_up(echo, i, wish)
        np.testing.assert_allclose(wish, expected, atol=1e-4)
        add_to(echo, i, expected)
        error += own[:, None] * expected
        make_up(echo, i, wish)
        np.testing.assert_allclose(wish, expected, atol=1e-4)
    assert moved > 0.01


def test_nothing_is_made_up_for_without_a_picture() -> None:
    echo, wish = silence(), np.array([1.0, 2.0, 3.0])
    add_to(echo, 7, np.ones(3))
    make_up(echo, 7, wish)
    assert wish.tolist() == [1, 2, 3]
