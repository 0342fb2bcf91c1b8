"""What files of former versions were made with, where it is another than today."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.blending import ALONG
from gcvec.codec.colors import FRACTION
from gcvec.kernels import kernel

Ints = NDArray[np.int64]

FORMER_NEIGHBORS = 6
"""So many points told a colour before version 6,"""

NOT_ALONG = ALONG[..., :0].copy()
"""along no directions."""

_REACH = 3
"""Points within so many rows and columns told how dense they are, before version 7."""


def even_strides(n: int) -> Ints:
    """Strides `(n,)` of colours that are all stored in whole steps, as before version 7."""
    return np.full(n, FRACTION)


@kernel
def former_crowds(points: Ints, occupied: NDArray[np.uint8]) -> Ints:
    """How dense control points, of a bitmap `(h, w)`, are around each of points `(n, 2)`: a third of how many
    there are among 7 x 7 pixels, known or to come, from 0 to 15."""
    height, width = occupied.shape
    crowds = np.zeros(len(points), np.int64)
    for i in range(len(points)):
        x, y = points[i, 0], points[i, 1]
        total = 0
        for row in range(max(y - _REACH, 0), min(y + _REACH + 1, height)):
            for column in range(max(x - _REACH, 0), min(x + _REACH + 1, width)):
                total += occupied[row, column]
        crowds[i] = min(total // 3, 15)
    return crowds
