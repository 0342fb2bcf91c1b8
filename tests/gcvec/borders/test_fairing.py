"""What bends least, against scipy's solver and in plain cases."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import solveh_banded

from gcvec.borders.fairing import solved


@pytest.mark.parametrize("n", [1, 2, 3, 4, 50])
def test_five_diagonals_are_solved_as_scipy_does(n: int) -> None:
    rng = np.random.default_rng(n)
    factor = np.tril(rng.normal(size=(n, n)))
    factor[np.tril_indices(n, -3)] = 0.0
    matrix = factor @ factor.T + np.eye(n)
    diagonals = np.zeros((3, n))
    for j in range(min(n, 3)):
        diagonals[j, j:] = np.diagonal(matrix, -j)
    right = rng.normal(size=(n, 2))
    x = solved(diagonals, right)
    np.testing.assert_allclose(matrix @ x, right, atol=1e-9)
    np.testing.assert_allclose(x, solveh_banded(diagonals[: min(n, 3)][::-1], right), atol=1e-9)
