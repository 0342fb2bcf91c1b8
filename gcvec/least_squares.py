"""Sparse least squares with every unknown in [0, 1] (paper, section 4.3 and equation (7))."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

Floats = NDArray[np.float64]


def solve_normal(normal: sparse.csr_array, right: Floats) -> Floats:
    """Solution `(n, k)` of a symmetric positive definite system."""
    factor = linalg.splu(
        normal.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return np.asarray(factor.solve(right))


def bounded_least_squares(normal: sparse.csr_array, right: Floats, sweeps: int = 20) -> Floats:
    """Minimiser `(n, k)` of xᵀ N x / 2 - xᵀ r over [0, 1]^n, column by column, for positive definite N.

    Unbounded first; a column that leaves the box goes on as a primal-dual active set method (Hintermüller, Ito and Kunisch
    2002), which ends at the exact solution once the set of unknowns at their bounds repeats.
    """
    x = solve_normal(normal, right)
    for k in np.flatnonzero(((x < 0) | (x > 1)).any(axis=0)):
        x[:, k] = _primal_dual_active_set(normal, right[:, k], x[:, k], sweeps)
    return x


def _primal_dual_active_set(normal: sparse.csr_array, right: Floats, x: Floats, sweeps: int) -> Floats:
    scale = normal.diagonal()
    multiplier = np.zeros_like(x)
    low, high = x < 0, x > 1
    for _ in range(sweeps):
        free = np.flatnonzero(~(low | high))
        x = np.where(high, 1.0, 0.0)
        if len(free):
            rest = right - normal @ x
            x[free] = solve_normal(normal[free][:, free], rest[free])
        multiplier = right - normal @ x
        multiplier[free] = 0.0
        new_low, new_high = x + multiplier / scale < 0, x + multiplier / scale > 1
        if np.array_equal(low, new_low) and np.array_equal(high, new_high):
            break
        low, high = new_low, new_high
    return np.clip(x, 0.0, 1.0)
