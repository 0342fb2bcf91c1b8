"""The bitmap of interior control points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.integers import size_class
from gcvec.codec.mixing import Model, code_decision
from gcvec.codec.range_coder import Coder
from gcvec.kernels import kernel

_REACH = 7
"""Pixels to either side, and rows with the pixel's own, that contexts look at."""

_BANDS = 32
_BY_FEW, _BY_MANY, _BY_BOTH, _BY_PATTERN = 1024, 2048, 4096, 8192
"""Where the counters of the second to the last context begin."""

OCCUPANCY_COUNTERS = _BY_PATTERN + 2048
OCCUPANCY_ROWS, OCCUPANCY_INPUTS = 24 * _BANDS, 5


@kernel
def code_occupancy(coder: Coder, model: Model, occupied: NDArray[np.uint8]) -> None:
    """Write a bitmap `(h, w)`, or read it, row by row.

    The contexts are the exact pattern of the ten pixels closest by, how many are set within 3 and within 7
    pixels, and how dense the bitmap has been further up and to the left.
    """
    height, width = occupied.shape
    seen = np.zeros((_REACH, width + 2 * _REACH), np.int64)
    near, wide = np.zeros(width + 2 * _REACH, np.int64), np.zeros(width + 2 * _REACH, np.int64)
    column = np.zeros(width + 2, np.int64)
    for y in range(height):
        # Rows move up by one; `near` and `wide` count what is set above, column by column.
        for x in range(width + 2 * _REACH):
            for k in range(_REACH - 1, 0, -1):
                seen[k, x] = seen[k - 1, x]
            seen[0, x] = 0
            near[x] = seen[1, x] + seen[2, x] + seen[3, x]
            wide[x] = near[x] + seen[4, x] + seen[5, x] + seen[6, x]
        row = 0
        for x in range(width):
            c = x + _REACH
            far = (2 * column[x + 1] + column[x] + column[x + 2] + 4 * row) >> 3
            band = min(size_class(far >> 5), _BANDS - 1)
            touching = seen[0, c - 1] + 2 * seen[1, c] + 4 * seen[1, c - 1] + 8 * seen[1, c + 1]
            pattern = touching + 16 * seen[0, c - 2] + 32 * seen[2, c]
            around = seen[1, c - 2] + 2 * seen[1, c + 2] + 4 * seen[2, c - 1] + 8 * seen[2, c + 1]
            few = seen[0, c - 1] + seen[0, c - 2] + seen[0, c - 3]
            many = few
            for k in range(4, _REACH + 1):
                many += seen[0, c - k]
            for k in range(-3, 4):
                few += near[c + k]
            for k in range(-_REACH, _REACH + 1):
                many += wide[c + k]
            model.slots[0] = pattern * 16 + around
            model.slots[1] = _BY_FEW + few * _BANDS + band
            model.slots[2] = _BY_MANY + many * 16 + touching
            model.slots[3] = _BY_BOTH + few * 128 + many
            model.slots[4] = _BY_PATTERN + pattern * _BANDS + band
            selector = min(few, 23) * _BANDS + band
            bit = code_decision(coder, model, 0, 5, 0, selector, occupied[y, x])
            occupied[y, x] = bit
            seen[0, c] = bit
            column[x + 1] += ((bit << 14) - column[x + 1]) >> 4
            row += ((bit << 14) - row) >> 4
