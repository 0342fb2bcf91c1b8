"""Colours as small integers: differences from a prediction, in a decorrelated basis, in steps.

A colour is taken apart into lightness and two chroma axes. The basis is orthonormal, so equal steps are what
mean squared error over R, G and B asks for. Predictions are made in units of a sixteenth of a step, from
colours as a decoder knows them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BASIS = np.array([[1.0, 1.0, 1.0], [1.0, 0.0, -1.0], [1.0, -2.0, 1.0]])
BASIS /= np.linalg.norm(BASIS, axis=1)[:, None]

FRACTION = 16
"""Units of a prediction in a step."""

DEAD_ZONE = 0.12
"""Differences of which little is expected are rounded towards zero by this share of a step more than to
nearest: it saves more than it costs."""


def to_coordinates(differences: Floats, step: float) -> Floats:
    """Differences of colours `(n, 3)` along the axes of the basis, in steps."""
    return np.asarray(differences @ BASIS.T / step)


def from_coordinates(coordinates: Ints, step: float) -> Floats:
    """Differences of colours `(n, 3)` from coordinates in sixteenths of a step."""
    return np.asarray(coordinates * (step / FRACTION) @ BASIS)


@bare_kernel
def rounded(value: float, usual: float) -> int:
    """A difference in steps, as it is stored, where differences are `usual` steps in size.

    A step less saves the more bits the smaller differences are.
    """
    whole = int(np.floor(abs(value) + 0.5 - DEAD_ZONE / (1.0 + usual)))
    return -whole if value < 0 else whole
