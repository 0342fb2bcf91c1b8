"""Structural similarity (Wang et al. 2004), a few rows of a channel at a time."""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import NDArray

from gcvec.parallel import in_turn
from gcvec.smoothing import box_mean

Floats = NDArray[np.float64]

WINDOW = 7
THIN = 3
"""A side of fewer pixels lies within every window."""

STABILIZERS = (0.01 * 255) ** 2, (0.03 * 255) ** 2
"""C1 and C2 of the paper."""

BAND = 256
"""Rows at a time: memory does not grow with the picture."""


def ssim(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> float:
    """Mean over pixels and channels of two pictures `(h, w, 3)`, with a flat window of 7 x 7 pixels, smaller
    for smaller pictures, that stays inside. Of a picture 1 or 2 pixels wide or high it holds the whole width
    or height.
    """
    height, width = a.shape[:2]
    window = min([WINDOW, *(side for side in (height, width) if side >= THIN)])
    window -= 1 - window % 2
    rows, columns = (side - window + 1 if side >= THIN else 1 for side in (height, width))

    def share(band: tuple[int, int]) -> float:
        first, channel = band
        own = slice(first, first + BAND + window - 1)
        return float(_similarities(a[own, :, channel], b[own, :, channel], window).sum())

    total = sum(in_turn(share, [(first, k) for first in range(0, rows, BAND) for k in range(3)]))
    return float(total / (3 * rows * columns))


def _similarities(a: NDArray[np.uint8], b: NDArray[np.uint8], window: int) -> Floats:
    """The similarity of every window that fits into two channels."""
    x, y = a.astype(np.float64), b.astype(np.float64)
    mx, my, mxx, myy, mxy = (_means(z, window) for z in (x, y, x * x, y * y, x * y))
    n = prod(window if side >= THIN else side for side in x.shape)
    unbiased = n / max(n - 1, 1)
    vx, vy, vxy = unbiased * (mxx - mx * mx), unbiased * (myy - my * my), unbiased * (mxy - mx * my)
    c1, c2 = STABILIZERS
    similar = (2 * mx * my + c1) * (2 * vxy + c2)
    return np.asarray(similar / ((mx * mx + my * my + c1) * (vx + vy + c2)))


def _means(channel: Floats, window: int) -> Floats:
    """The mean of every window that fits into a channel; its thin sides lie within each."""
    thin = tuple(axis for axis in (0, 1) if channel.shape[axis] < THIN)
    if thin:
        channel = channel.mean(axis=thin, keepdims=True)
    edge = window // 2
    down, across = (slice(None) if side == 1 else slice(edge, side - edge) for side in channel.shape)
    return box_mean(channel, window)[down, across]
