"""Bounded least squares against scipy's exact solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import lsq_linear

from gcvec.colors.least_squares import NormalEquations, solve, solve_bounded

PULL = 0.01


def problem(seed: int, stretch: float) -> tuple[np.ndarray, np.ndarray, NormalEquations]:
    """min |A x - b|² + PULL |x - 1/2|² as a stacked matrix and as normal equations in two factors."""
    rng = np.random.default_rng(seed)
    n, k, rows = 30, 50, 90
    inner = np.where(rng.uniform(size=(k, n)) < 0.15, rng.uniform(0, 1, (k, n)), 0)
    outer = np.where(rng.uniform(size=(rows, k)) < 0.1, rng.uniform(0, 1, (rows, k)), 0)
    target = outer @ inner @ (0.5 + stretch * rng.normal(size=(n, 3))) + 0.05 * rng.normal(size=(rows, 3))
    stacked = np.vstack([outer @ inner, PULL**0.5 * np.eye(n)])
    right = np.vstack([target, np.full((n, 3), PULL**0.5 * 0.5)])
    equations = NormalEquations(
        sparse.csr_array(inner),
        sparse.csr_array(outer),
        np.full(n, PULL),
        inner.T @ (outer.T @ target) + PULL * 0.5,
    )
    return stacked, right, equations


@pytest.mark.parametrize("seed", range(4))
def test_unbounded_solution_is_the_least_squares_solution(seed: int) -> None:
    stacked, right, equations = problem(seed, 0.3)
    x = solve(equations, np.full((30, 3), 0.5), 2000, 1e-13)
    np.testing.assert_allclose(x, np.linalg.lstsq(stacked, right, rcond=None)[0], atol=1e-8)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("stretch", [0.05, 0.3, 1.0])
def test_bounded_solution_is_scipys(seed: int, stretch: float) -> None:
    stacked, right, equations = problem(seed, stretch)
    x = solve_bounded(equations, np.full((30, 3), 0.5), 2000, 1e-12)
    assert x.min() >= 0
    assert x.max() <= 1
    for c in range(3):
        exact = lsq_linear(stacked, right[:, c], bounds=(0, 1), method="bvls", tol=1e-14)
        np.testing.assert_allclose(x[:, c], exact.x, atol=1e-5)


def test_apply_is_the_product_of_the_factors() -> None:
    rng = np.random.default_rng(4)
    operator, design = rng.uniform(size=(7, 4)), np.where(rng.uniform(size=(20, 7)) < 0.4, 1.5, 0)
    pull, x = rng.uniform(size=4), rng.normal(size=(4, 3))
    equations = NormalEquations(sparse.csr_array(operator), sparse.csr_array(design), pull, np.zeros((4, 3)))
    full = operator.T @ design.T @ design @ operator + np.diag(pull)
    np.testing.assert_allclose(equations.apply(x), full @ x)


def test_diagonal_is_exact_where_the_gram_matrix_is_diagonal() -> None:
    rng = np.random.default_rng(1)
    operator, scale = rng.uniform(size=(7, 4)), rng.uniform(size=7)
    equations = NormalEquations(
        sparse.csr_array(operator), sparse.diags_array(scale).tocsr(), rng.uniform(size=4), np.zeros((4, 3))
    )
    full = operator.T @ np.diag(scale**2) @ operator + np.diag(equations.pull)
    np.testing.assert_allclose(equations.diagonal, np.diag(full))


def test_fixed_unknowns_keep_their_values() -> None:
    stacked, right, equations = problem(2, 0.3)
    fixed = np.zeros((30, 3), bool)
    fixed[4:9, 1] = True
    start = np.full((30, 3), 0.25)
    x = solve(equations, start, 2000, 1e-13, fixed)
    assert (x[fixed] == 0.25).all()
    free = ~fixed[:, 1]
    rest = right[:, 1] - stacked[:, ~free] @ np.full((~free).sum(), 0.25)
    expected = np.linalg.lstsq(stacked[:, free], rest, rcond=None)[0]
    np.testing.assert_allclose(x[free, 1], expected, atol=1e-8)


def test_a_good_start_needs_no_step() -> None:
    _, _, equations = problem(3, 0.3)
    exact = solve(equations, np.full((30, 3), 0.5), 2000, 1e-14)
    np.testing.assert_array_equal(solve(equations, exact, 0, 1e-6), exact)
    np.testing.assert_allclose(solve(equations, exact, 50, 1e-6), exact, atol=1e-9)
