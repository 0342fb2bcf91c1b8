"""Borders without the waves that nobody can see in the photo.

Samples that are surely known stay; between and beside them the border takes the way that bends least.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from gcvec.chains import Chains

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
    diagonals[2] = weight + 4 * bend
    diagonals[2, :-1] += bend[1:]
    diagonals[2, 1:] += bend[:-1]
    diagonals[1, 1:] = -2 * (bend[1:] + bend[:-1])
    diagonals[0, 2:] = bend[1:-1]
    placed = solveh_banded(diagonals, weight[:, None] * points[source], check_finite=False)
    return np.asarray(placed[kept])


def _unrolled(chains: Chains) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Indices of samples with closed chains run on, which of them are the chain's own, and the offsets."""
    size, extra = np.diff(chains.offsets), np.where(chains.closed, OVERLAP, 0)
    runs = size + 2 * extra
    breaks = np.concatenate([[0], np.cumsum(runs)])
    around = np.arange(breaks[-1]) - np.repeat(breaks[:-1] + extra, runs)
    sources = np.repeat(chains.offsets[:-1], runs) + around % np.repeat(size, runs)
    return sources, (around >= 0) & (around < np.repeat(size, runs)), breaks
