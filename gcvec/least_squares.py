"""Sparse least squares with every unknown in [0, 1] (paper, section 4.3 and equation (7))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]

BOUND_SWEEPS = 6


@dataclass(frozen=True)
class NormalEquations:
    """N x = r with N = Rᵀ G R + diag(pull), positive definite, never multiplied out.

    operator  R `(k, n)`, from the unknowns to intermediate values
    gram      G `(k, k)`, symmetric
    pull      `(n,)`, positive
    right     r `(n, c)`
    """

    operator: sparse.csr_array
    gram: sparse.csr_array
    pull: Floats
    right: Floats

    def apply(self, x: Floats) -> Floats:
        """N x for x `(n, c)`."""
        product: Floats = self.operator.T @ (self.gram @ (self.operator @ x)) + self.pull[:, None] * x
        return product

    def diagonal(self) -> Floats:
        """Diagonal of N, but for the terms of G off its own diagonal: the preconditioner."""
        squares = self.operator.copy()
        squares.data **= 2
        diagonal: Floats = squares.T @ self.gram.diagonal() + self.pull
        return diagonal


def solve(
    equations: NormalEquations,
    start: Floats,
    iterations: int,
    tolerance: float,
    fixed: NDArray[np.bool_] | None = None,
) -> Floats:
    """Preconditioned conjugate gradients from `start` `(n, c)`, all columns at once.

    Ends after `iterations`, or when every column's residual has fallen below `tolerance` of its right-hand
    side.
    Unknowns where `fixed` `(n, c)` is set keep their start values.
    """
    scale = 1 / equations.diagonal()[:, None]
    moving = 1.0 if fixed is None else (~fixed).astype(np.float64)
    x = start.copy()
    residual = moving * (equations.right - equations.apply(x))
    enough = tolerance**2 * (scale * equations.right**2).sum(axis=0)
    preconditioned = scale * residual
    energy = (residual * preconditioned).sum(axis=0)
    direction = preconditioned
    for _ in range(iterations):
        if (energy <= enough).all():
            break
        image = moving * equations.apply(direction)
        step = energy / np.maximum((direction * image).sum(axis=0), 1e-300)
        x += step * direction
        residual -= step * image
        preconditioned = scale * residual
        before, energy = energy, (residual * preconditioned).sum(axis=0)
        direction = preconditioned + energy / np.maximum(before, 1e-300) * direction
    return x


def solve_bounded(equations: NormalEquations, start: Floats, iterations: int, tolerance: float) -> Floats:
    """The minimiser of xᵀ N x / 2 - xᵀ r over [0, 1], as closely as conjugate gradients come.

    Unbounded first; while unknowns leave the box, a primal-dual active set method (Hintermüller, Ito and
    Kunisch 2002) holds at their bounds those that the multipliers press there.
    """
    x = solve(equations, start, iterations, tolerance)
    low, high = x < 0, x > 1
    for _ in range(BOUND_SWEEPS):
        if not (low.any() or high.any()):
            break
        held = low | high
        x = solve(equations, np.where(high, 1.0, np.where(low, 0.0, x)), iterations, tolerance, held)
        pressure = np.where(held, equations.right - equations.apply(x), 0.0)
        probe = x + pressure / equations.diagonal()[:, None]
        new_low, new_high = probe < 0, probe > 1
        if np.array_equal(low, new_low) and np.array_equal(high, new_high):
            break
        low, high = new_low, new_high
    return np.clip(x, 0.0, 1.0)
