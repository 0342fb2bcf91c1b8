"""Annotated borders → image edges: a watershed on the gradient inside a narrow band along the borders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel
from gcvec.morphology import dilated
from gcvec.regions.watershed import flooded

Floats = NDArray[np.float64]

BLUR = 0.7
"""Standard deviation of the smoothing before the gradient, pixels."""

TAPS = 3
"""Pixels either way that take part in it."""


def snap_borders(labels: NDArray[np.int32], picture: Floats, band: float) -> NDArray[np.int32]:
    """The label map `(h, w) int32` with every border moved onto the image's edges.

    Pixels whose centres are within `band` pixels of a border can change sides. `picture` is `(h, w, 3)` in
    [0, 1]. Regions without a pixel outside the band keep the middle of theirs, so none is lost.
    """
    if band <= 0 or labels.min() == labels.max():
        return labels
    seeds = _seeds(labels, _offsets(band))
    return flooded(_steepness(picture, dilated(seeds == 0, rows=True, columns=True), *_kernels()), seeds) - 1


def _offsets(band: float) -> NDArray[np.int64]:
    """Steps to all pixels that are in the band if this one is at the border, `(k, 3)` of dy, dx and squared
    distance: the border itself runs half a pixel beside."""
    reach = int(band)
    y, x = np.mgrid[-reach : reach + 1, -reach : reach + 1]
    square = y * y + x * x
    inside = np.sqrt(square) + 0.5 <= band
    return np.stack([y[inside], x[inside], square[inside]], axis=1).astype(np.int64)


@kernel
def _seeds(labels, offsets):
    """Labels from 1 of the pixels outside the band, or, of regions that have none, of the deepest; else 0."""
    height, width = labels.shape
    far = np.iinfo(np.int64).max
    square = np.full((height, width), far, np.int64)
    for y in range(height):
        for x in range(width):
            own = labels[y, x]
            if (
                (y > 0 and labels[y - 1, x] != own)
                or (x > 0 and labels[y, x - 1] != own)
                or (x < width - 1 and labels[y, x + 1] != own)
                or (y < height - 1 and labels[y + 1, x] != own)
            ):
                for k in range(len(offsets)):
                    v, u = y + offsets[k, 0], x + offsets[k, 1]
                    if 0 <= v < height and 0 <= u < width and offsets[k, 2] < square[v, u]:
                        square[v, u] = offsets[k, 2]
    deepest = np.full(labels.max() + 1, -1, np.int64)
    for y in range(height):
        for x in range(width):
            deepest[labels[y, x]] = max(deepest[labels[y, x]], square[y, x])
    seeds = np.zeros((height, width), np.int32)
    for y in range(height):
        for x in range(width):
            if square[y, x] == deepest[labels[y, x]]:
                seeds[y, x] = labels[y, x] + 1
    return seeds


def _kernels() -> tuple[Floats, Floats]:
    """A Gaussian and its derivative, `(2 * TAPS + 1,)` each."""
    x = np.arange(-TAPS, TAPS + 1)
    smooth = np.exp(-(x**2) / (2 * BLUR**2))
    smooth /= smooth.sum()
    return smooth, smooth * x / BLUR**2


@kernel
def _steepness(picture, wanted, smooth, slope):
    """The magnitude of the smoothed picture's gradient, summed over its channels, where it is `wanted`.

    Beyond the frame the picture is mirrored.
    """
    height, width, channels = picture.shape
    needed = np.zeros((height, width), np.bool_)
    for y in range(height):
        for x in range(width):
            if wanted[y, x]:
                for v in range(max(y - TAPS, 0), min(y + TAPS + 1, height)):
                    needed[v, x] = True
    along, across = np.empty(picture.shape), np.empty(picture.shape)
    for y in range(height):
        for x in range(width):
            if not needed[y, x]:
                continue
            for c in range(channels):
                along[y, x, c] = across[y, x, c] = 0.0
                for k in range(-TAPS, TAPS + 1):
                    value = picture[y, _mirrored(x + k, width), c]
                    along[y, x, c] += slope[k + TAPS] * value
                    across[y, x, c] += smooth[k + TAPS] * value
    steepness = np.zeros((height, width))
    for y in range(height):
        for x in range(width):
            if not wanted[y, x]:
                continue
            for c in range(channels):
                gx, gy = 0.0, 0.0
                for k in range(-TAPS, TAPS + 1):
                    v = _mirrored(y + k, height)
                    gx += smooth[k + TAPS] * along[v, x, c]
                    gy += slope[k + TAPS] * across[v, x, c]
                steepness[y, x] += np.sqrt(gx * gx + gy * gy)
    return steepness


@kernel
def _mirrored(k, n):
    while k < 0 or k >= n:
        k = -1 - k if k < 0 else 2 * n - 1 - k
    return k
