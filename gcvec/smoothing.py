"""Separable filters of one channel. Beyond its frame a picture goes on as it ends there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel
from gcvec.parallel import in_shares

Floats = NDArray[np.float64]
Channel = NDArray[np.float32]

REACH = 4.0
"""Gaussians are cut off at so many standard deviations."""


def gaussian(channel: NDArray[np.floating], sigma: float, order: tuple[int, int] = (0, 0)) -> Channel:
    """A channel `(h, w)` smoothed by a Gaussian of standard deviation `sigma`, pixels, or a derivative of
    that, of these orders down and across, up to 2."""
    source = np.ascontiguousarray(channel, np.float32)
    down, across = (_weights(sigma, n) for n in order)
    between, smooth = np.empty_like(source), np.empty_like(source)
    in_shares(lambda first, last: _filter_across(source, across, first, last, between), len(source))
    in_shares(lambda first, last: _filter_down(between, down, first, last, smooth), len(source))
    return smooth


def _weights(sigma: float, order: int) -> Floats:
    """The Gaussian, of sum 1, or its first or second derivative at whole offsets."""
    reach = int(REACH * sigma + 0.5)
    offset = np.arange(-reach, reach + 1)
    weights = np.exp(-0.5 * (offset / sigma) ** 2)
    weights /= weights.sum()
    factor = (1.0, offset / sigma**2, (offset**2 / sigma**2 - 1) / sigma**2)[order]
    return np.asarray(factor * weights)


@kernel
def _filter_across(source, weights, first, last, out):
    width, reach = source.shape[1], len(weights) // 2
    padded, total = np.empty(width + 2 * reach), np.empty(width)
    for y in range(first, last):
        padded[:reach] = source[y, 0]
        padded[reach : reach + width] = source[y]
        padded[reach + width :] = source[y, width - 1]
        total[:] = 0.0
        for k in range(len(weights)):
            for x in range(width):
                total[x] += weights[k] * padded[x + k]
        out[y] = total


@kernel
def _filter_down(source, weights, first, last, out):
    height, width = source.shape
    total = np.empty(width)
    for y in range(first, last):
        total[:] = 0.0
        for k in range(len(weights)):
            row = min(max(y + k - len(weights) // 2, 0), height - 1)
            for x in range(width):
                total[x] += weights[k] * source[row, x]
        out[y] = total


def box_mean(channel: Floats, window: int) -> Floats:
    """The mean of every square of `window` pixels, an odd number, about the pixels of a channel `(h, w)`."""
    between = _running_mean(np.ascontiguousarray(channel), window)
    return np.ascontiguousarray(_running_mean(np.ascontiguousarray(between.T), window).T)


@kernel
def _running_mean(source, window):
    """Along rows."""
    height, width = source.shape
    reach = window // 2
    means = np.empty((height, width))
    for y in range(height):
        total = 0.0
        for offset in range(-reach, reach):
            total += source[y, min(max(offset, 0), width - 1)]
        for x in range(width):
            total += source[y, min(x + reach, width - 1)]
            means[y, x] = total / window
            total -= source[y, max(x - reach, 0)]
    return means
