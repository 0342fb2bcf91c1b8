"""Sparse least squares with every unknown in [0, 1] (paper, section 4.3 and equation (7))."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.kernels import bare_kernel, kernel
from gcvec.parallel import in_shares

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class NormalEquations:
    """N x = r with N = Rᵀ Bᵀ B R + diag(pull), positive definite, never multiplied out.

    operator  R `(k, n)`, from the unknowns to intermediate values
    design    B `(p, k)`, from those to the values that are fitted
    pull      `(n,)`, positive
    right     r `(n, 3)`
    """

    operator: sparse.csr_array
    design: sparse.csr_array
    pull: Floats
    right: Floats

    def apply(self, x: Floats) -> Floats:
        """N x for x `(n, 3)`."""
        r, b = self.operator, self.design
        values = np.empty((r.shape[0], 3))
        _product(r.indptr, r.indices, r.data, x, values)
        shares = in_shares(
            lambda first, last: _gram_product(b.indptr, b.indices, b.data, values, first, last), b.shape[0]
        )
        back = self.pull[:, None] * x
        _add_back(r.indptr, r.indices, r.data, tuple(shares), back)
        return back

    def residual(self, x: Floats) -> Floats:
        """r - N x for x `(n, 3)`."""
        return self.right - self.apply(x)

    @cached_property
    def diagonal(self) -> Floats:
        """Diagonal of N, but for the terms of BᵀB off its own diagonal: the preconditioner."""
        squares = self.operator.copy()
        squares.data **= 2
        diagonal: Floats = squares.T @ energies(self.design) + self.pull
        return diagonal


def misfit(design: sparse.csr_array, values: Floats, target: NDArray[np.float32]) -> NDArray[np.float32]:
    """y - B x for B `(p, k)`, x `(k, 3)` and y `(p, 3)`."""
    rest = np.empty(target.shape, np.float32)
    rows = (design.indptr, design.indices, design.data, np.ascontiguousarray(values), target)
    in_shares(lambda first, last: _misfit(*rows, first, last, rest), len(rest))
    return rest


def from_pixels(design: sparse.csr_array, picture: NDArray[np.float32]) -> Floats:
    """Bᵀ y for B `(p, k)` and y `(p, 3)`."""

    def share(first: int, last: int) -> Floats:
        part = np.zeros((design.shape[1], 3))
        _scatter(design.indptr, design.indices, design.data, picture, first, last, part)
        return part

    return _total(in_shares(share, len(picture)))


def _total(parts: list[Floats]) -> Floats:
    """The sum of parts of one shape, in the place of the first."""
    total, *others = parts
    for part in others:
        total += part
    return total


@bare_kernel
def _row_product(indptr, indices, data, x, row):
    """One row of B x."""
    red, green, blue = 0.0, 0.0, 0.0
    for e in range(indptr[row], indptr[row + 1]):
        weight, column = data[e], indices[e]
        red += weight * x[column, 0]
        green += weight * x[column, 1]
        blue += weight * x[column, 2]
    return red, green, blue


@bare_kernel
def _product(indptr, indices, data, x, out):
    """B x, for B in compressed rows and x `(n, 3)`."""
    for row in range(len(out)):
        out[row, 0], out[row, 1], out[row, 2] = _row_product(indptr, indices, data, x, row)


@bare_kernel
def _add_back(indptr, indices, data, parts, out):
    """Add Bᵀ y, for B in compressed rows and y `(k, 3)`, the sum of the parts."""
    for row in range(len(indptr) - 1):
        red, green, blue = 0.0, 0.0, 0.0
        for part in parts:
            red += part[row, 0]
            green += part[row, 1]
            blue += part[row, 2]
        for e in range(indptr[row], indptr[row + 1]):
            weight, column = data[e], indices[e]
            out[column, 0] += weight * red
            out[column, 1] += weight * green
            out[column, 2] += weight * blue


@bare_kernel
def _misfit(indptr, indices, data, x, y, first, last, out):
    for row in range(first, last):
        red, green, blue = _row_product(indptr, indices, data, x, row)
        out[row, 0], out[row, 1], out[row, 2] = y[row, 0] - red, y[row, 1] - green, y[row, 2] - blue


@bare_kernel
def _scatter(indptr, indices, data, y, first, last, out):
    for row in range(first, last):
        for e in range(indptr[row], indptr[row + 1]):
            weight, column = data[e], indices[e]
            out[column, 0] += weight * y[row, 0]
            out[column, 1] += weight * y[row, 1]
            out[column, 2] += weight * y[row, 2]


def energies(design: sparse.csr_array) -> Floats:
    """Squared sum of every column: the diagonal of BᵀB."""
    total = np.zeros(design.shape[1])
    _add_squares(design.indices, design.data, total)
    return total


@bare_kernel
def _add_squares(indices, data, total):
    for e in range(len(indices)):
        total[indices[e]] += data[e] * data[e]


@kernel
def _gram_product(indptr, indices, data, x, first, last):
    """The share of the rows `first` to `last` in BᵀB x, for B in compressed rows and x `(k, 3)`."""
    out = np.zeros_like(x)
    for row in range(first, last):
        red, green, blue = _row_product(indptr, indices, data, x, row)
        for e in range(indptr[row], indptr[row + 1]):
            weight, column = data[e], indices[e]
            out[column, 0] += weight * red
            out[column, 1] += weight * green
            out[column, 2] += weight * blue
    return out


def solve(
    equations: NormalEquations,
    start: Floats,
    iterations: int,
    tolerance: float,
    fixed: NDArray[np.bool_] | None = None,
    residual: Floats | None = None,
) -> Floats:
    """Preconditioned conjugate gradients from `start` `(n, 3)`, all columns at once.

    Ends after `iterations`, or when every column's residual has fallen below `tolerance` of its right-hand
    side. Unknowns where `fixed` `(n, 3)` is set keep their start values. The `residual` `(n, 3)` at the start
    need not be given.
    """
    scale = 1 / equations.diagonal
    moving = np.ones(start.shape, bool) if fixed is None else ~fixed
    x = start.copy()
    residual = moving * (equations.residual(x) if residual is None else residual)
    direction = scale[:, None] * residual
    energy = _sums(residual, direction)
    enough = tolerance**2 * _sums(scale[:, None] * equations.right, equations.right)
    for _ in range(iterations):
        if (energy <= enough).all():
            break
        _advance(x, residual, direction, energy, equations.apply(direction), scale, moving)
    return x


def _sums(a: Floats, b: Floats) -> Floats:
    """Scalar products of the columns of `a` and `b`, `(n, 3)` each."""
    return np.asarray(np.einsum("nk,nk->k", a, b))


@kernel
def _advance(x, residual, direction, energy, image, scale, moving):
    """A step of conjugate gradients in place, `image` being that of the direction, and the next direction."""
    along = np.zeros(3)
    for i in range(len(x)):
        for k in range(3):
            along[k] += direction[i, k] * image[i, k]
    step, before = energy / np.maximum(along, 1e-300), np.maximum(energy, 1e-300)
    energy[:] = 0.0
    for i in range(len(x)):
        for k in range(3):
            if moving[i, k]:
                x[i, k] += step[k] * direction[i, k]
                residual[i, k] -= step[k] * image[i, k]
                energy[k] += scale[i] * residual[i, k] ** 2
    turn = energy / before
    for i in range(len(x)):
        for k in range(3):
            direction[i, k] = scale[i] * residual[i, k] + turn[k] * direction[i, k]


def solve_bounded(
    equations: NormalEquations, start: Floats, iterations: int, tolerance: float, sweeps: int = 12
) -> Floats:
    """The minimiser of xᵀ N x / 2 - xᵀ r over [0, 1], as closely as conjugate gradients come.

    A primal-dual active set method (Hintermüller, Ito and Kunisch 2002): each of at most `sweeps` solves
    holds at their bounds the unknowns that left them in the one before, and those that are pressed there.
    For the first they follow from where it starts.
    """
    x = np.clip(start, 0.0, 1.0)
    residual = equations.residual(x)
    low, high = (x == 0) & (residual < 0), (x == 1) & (residual > 0)
    for sweep in range(1, sweeps + 1):
        held = low | high
        x = solve(equations, x, iterations, tolerance, held, residual)
        if sweep == sweeps:
            break
        probe = x + np.where(held, equations.residual(x), 0) / equations.diagonal[:, None]
        new_low, new_high = probe < 0, probe > 1
        if np.array_equal(low, new_low) and np.array_equal(high, new_high):
            break
        low, high = new_low, new_high
        x = np.where(high, 1.0, np.where(low, 0.0, x))
        residual = equations.residual(x)
    return np.clip(x, 0.0, 1.0)
