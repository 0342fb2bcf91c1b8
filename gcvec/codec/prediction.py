"""A linear prediction whose coefficients adapt as they are used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel

Floats = NDArray[np.float64]

FURTHEST = 1 << 30
"""Predictions, and what is predicted, stay within this, whatever a file says."""

_RATE = 0.15
"""How much of what was missing a coefficient takes up."""

_CAUTION, _OUTLIER, _START = 30.0, 10.0, 10.0
"""What makes changes small: features that have been large, one that is large now, and any at first."""


@bare_kernel
def nearest_integer(value: float) -> int:
    """The integer nearest to a prediction; 0 for what is none."""
    return int(np.floor(value + 0.5)) if abs(value) < FURTHEST else 0


@bare_kernel
def correction(gain: Floats, features: Floats) -> float:
    """The sum of `features` `(f,)` by their coefficients `gain` `(f,)`, in order."""
    total = 0.0
    for f in range(len(features)):
        total += gain[f] * features[f]
    return total


@bare_kernel
def learn(gain: Floats, power: Floats, features: Floats, missing: float) -> None:
    """Move the coefficients `(f,)` so that less would have been `missing`.

    `power` `(f,)` sums up the squares of the features: as it grows, changes become smaller (Duchi, Hazan
    and Singer, "Adaptive subgradient methods", 2011).
    """
    for f in range(len(features)):
        value = features[f]
        power[f] += value * value
        small = _CAUTION * np.sqrt(power[f]) + _OUTLIER * value * value + _START
        gain[f] += _RATE * missing * value / small
