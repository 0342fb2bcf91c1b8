"""Structural similarity (Wang et al. 2004), a few rows of a channel at a time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.parallel import in_turn
from gcvec.smoothing import box_mean

Floats = NDArray[np.float64]

WINDOW = 7
STABILIZERS = (0.01 * 255) ** 2, (0.03 * 255) ** 2
"""C1 and C2 of the paper."""

BAND = 256
"""Rows at a time: memory does not grow with the picture."""


def ssim(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Mean over pixels and channels of two pictures `(h, w, 3)`, with a flat window of 7 x 7 pixels, smaller
    for smaller pictures, that stays inside."""
    height, width = a.shape[:2]
    window = min(WINDOW, height, width)
    window -= 1 - window % 2
    if window < 3:
        return 1.0 if np.array_equal(a, b) else 0.0
    rows = height - window + 1

    def share(band: tuple[int, int]) -> float:
        first, channel = band
        own = slice(first, min(first + BAND, rows) + window - 1)
        return float(_similarities(a[own, :, channel], b[own, :, channel], window).sum())

    total = sum(in_turn(share, [(first, k) for first in range(0, rows, BAND) for k in range(3)]))
    return float(total / (3 * rows * (width - window + 1)))


def _similarities(a: NDArray[np.uint8], b: NDArray[np.uint8], window: int) -> Floats:
    """The similarity of every window that fits into two channels."""
    x, y = a.astype(np.float64), b.astype(np.float64)
    edge = window // 2
    inside = slice(edge, len(x) - edge), slice(edge, x.shape[1] - edge)
    mx, my, mxx, myy, mxy = (box_mean(z, window)[inside] for z in (x, y, x * x, y * y, x * y))
    unbiased = window**2 / (window**2 - 1)
    vx, vy, vxy = unbiased * (mxx - mx * mx), unbiased * (myy - my * my), unbiased * (mxy - mx * my)
    c1, c2 = STABILIZERS
    similar = (2 * mx * my + c1) * (2 * vxy + c2)
    return np.asarray(similar / ((mx * mx + my * my + c1) * (vx + vy + c2)))
