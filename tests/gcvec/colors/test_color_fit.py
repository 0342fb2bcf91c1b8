"""Equation (7) on a canvas, against the same with dense matrices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy import sparse

from gcvec.colors.color_fit import ColorFit, color_fit
from gcvec.colors.least_squares import energies, from_pixels, misfit, solve
from gcvec.patches.canonical import Canvas, lay_unfolded_canvas
from gcvec.raster import paint
from tests.gcvec.scenes import foundation_of, some_points


@dataclass(frozen=True)
class Case:
    canvas: Canvas
    truth: np.ndarray
    colors: np.ndarray
    fit: ColorFit


@cache
def case() -> Case:
    canvas, _ = lay_unfolded_canvas(foundation_of("voronoi"), some_points(foundation_of("voronoi"), 60))
    network = canvas.foundation.network
    rng = np.random.default_rng(0)
    truth = rng.random((network.width * network.height, 3)).astype(np.float32)
    fit = color_fit(canvas, canvas.coverage(canvas.unit[0]), truth)
    return Case(canvas, truth, rng.random((fit.operator.shape[1], 3)), fit)


def test_what_the_picture_lacks_is_told_of_the_picture_as_it_is_drawn() -> None:
    made = case()
    drawing, operator, corner_color = made.canvas.unit
    network = made.canvas.foundation.network
    colors = operator @ made.colors
    shown = paint(drawing.image, drawing.triangles, colors, corner_color, network.width, network.height)
    residual = made.fit.residual(made.colors, made.truth)
    assert residual.dtype == np.float32
    np.testing.assert_allclose(residual, made.truth - np.asarray(shown).reshape(-1, 3), atol=1e-5)


def test_equations_are_the_normal_equations_of_pixels_and_pulls() -> None:
    made, rng = case(), np.random.default_rng(1)
    dense = (made.fit.design @ made.fit.operator).toarray()
    prior, pull = rng.random(made.colors.shape), rng.uniform(0.1, 2, len(made.colors))
    equations = made.fit.equations(prior, pull)
    np.testing.assert_allclose(
        equations.apply(made.colors), dense.T @ (dense @ made.colors) + pull[:, None] * made.colors, atol=1e-4
    )
    np.testing.assert_allclose(equations.right, dense.T @ made.truth + pull[:, None] * prior, atol=1e-4)


def test_a_picture_that_the_canvas_can_show_is_found_again() -> None:
    """With hardly any pull, and from wherever one starts."""
    made = case()
    shown = (made.fit.design @ (made.fit.operator @ made.colors)).astype(np.float32)
    fit = made.fit.of(shown)
    n = len(made.colors)
    equations = fit.equations(np.full((n, 3), 0.5), np.full(n, 1e-6))
    found = solve(equations, np.zeros((n, 3)), 3000, 1e-12)
    assert np.abs(fit.residual(found, shown)).max() < 1e-3


@pytest.mark.parametrize("rows", [1, 7, 3000])
def test_products_with_sparse_matrices_are_those_with_dense_ones(rows: int) -> None:
    rng = np.random.default_rng(rows)
    dense = np.where(rng.random((rows, 40)) < 0.1, rng.normal(size=(rows, 40)), 0.0)
    values, target = rng.normal(size=(40, 3)), rng.normal(size=(rows, 3)).astype(np.float32)
    design = sparse.csr_array(dense)
    np.testing.assert_allclose(from_pixels(design, target), dense.T @ target, atol=1e-5)
    np.testing.assert_allclose(misfit(design, values, target), target - dense @ values, atol=1e-5)
    np.testing.assert_allclose(energies(design), (dense**2).sum(axis=0), atol=1e-9)
