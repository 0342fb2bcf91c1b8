"""Borders without the waves that nobody can see in the photo.

Samples that are surely known stay; between and beside them the border takes the way that bends least.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.chains import Chains
from gcvec.kernels import kernel

Floats = NDArray[np.float64]

STIFFNESS = 0.05
"""Weight of squared second differences against one sure sample, which they hardly move."""

OVERLAP = 16
"""Closed borders are solved as open ones that run on for so many samples either way."""


def faired(chains: Chains, points: Floats, weight: Floats) -> Floats:
    """Samples `(n, 2)` that minimise Σ weight |x - point|² + stiffness Σ |second difference|² of every chain.

    The ends of open chains stay.
    """
    source, kept, breaks = _unrolled(chains)
    weight = np.where(chains.at_node, 1e6, weight + 1e-6)[source]
    inner = np.ones(len(source), bool)
    inner[breaks[:-1]] = inner[breaks[1:] - 1] = False
    bend = STIFFNESS * inner
    diagonals = np.zeros((3, len(source)))
    # Every inner sample k adds its (x[k-1] - 2 x[k] + x[k+1])².
    diagonals[0] = weight + 4 * bend
    diagonals[0, :-1] += bend[1:]
    diagonals[0, 1:] += bend[:-1]
    diagonals[1, 1:] = -2 * (bend[1:] + bend[:-1])
    diagonals[2, 2:] = bend[1:-1]
    return np.asarray(solved(diagonals, weight[:, None] * points[source])[kept])


@kernel
def solved(diagonals, right):
    """x `(n, k)` with A x = right, for A symmetric, positive definite and of five diagonals, by A = L D Lᵀ.

    diagonals[j, i] is A[i, i - j], for j up to 2; what lies outside of A is 0.
    """
    n = len(right)
    pivot, lower = np.ones(n + 4), np.zeros((2, n + 4))
    x = np.zeros((n + 4, right.shape[1]))
    # There are two rows more at both ends, so that all have predecessors and successors.
    for i in range(2, n + 2):
        lower[1, i] = diagonals[2, i - 2] / pivot[i - 2]
        lower[0, i] = (diagonals[1, i - 2] - lower[1, i] * pivot[i - 2] * lower[0, i - 1]) / pivot[i - 1]
        pivot[i] = diagonals[0, i - 2] - lower[0, i] ** 2 * pivot[i - 1] - lower[1, i] ** 2 * pivot[i - 2]
        for k in range(right.shape[1]):
            x[i, k] = right[i - 2, k] - lower[0, i] * x[i - 1, k] - lower[1, i] * x[i - 2, k]
    for i in range(n + 1, 1, -1):
        for k in range(right.shape[1]):
            x[i, k] = x[i, k] / pivot[i] - lower[0, i + 1] * x[i + 1, k] - lower[1, i + 2] * x[i + 2, k]
    return x[2 : n + 2]


def _unrolled(chains: Chains) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Indices of samples with closed chains run on, which of them are the chain's own, and the offsets."""
    size, extra = np.diff(chains.offsets), np.where(chains.closed, OVERLAP, 0)
    runs = size + 2 * extra
    breaks = np.concatenate([[0], np.cumsum(runs)])
    around = np.arange(breaks[-1]) - np.repeat(breaks[:-1] + extra, runs)
    sources = np.repeat(chains.offsets[:-1], runs) + around % np.repeat(size, runs)
    return sources, (around >= 0) & (around < np.repeat(size, runs)), breaks
