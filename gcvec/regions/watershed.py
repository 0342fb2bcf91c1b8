"""Watershed by flooding from seeds (Meyer 1994): a pixel goes to the seed whose flood reaches it first."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel

Values = NDArray[np.float32] | NDArray[np.float64]


def flooded(values: Values, seeds: NDArray[np.int32]) -> NDArray[np.int32]:
    """The labels `(h, w)` of pixels flooded from `seeds` `(h, w)`, which are 0 where there is none.

    A flood rises over `values` `(h, w)`, which are not negative, and spreads to the four neighbours, the
    lowest pixel first, of equal ones that which was reached first, of seeds the first in raster order.
    """
    labels = np.ascontiguousarray(seeds, np.int32).copy()
    # Floats that are not negative are ordered as their bits are.
    _flood(np.ascontiguousarray(values, np.float32).view(np.int32), labels)
    return labels


def minima(values: Values) -> NDArray[np.int32]:
    """Every local minimum, numbered from 1 in raster order, else 0, `(h, w)`: connected pixels of one value
    without a lower one beside them."""
    return np.asarray(_minima(values))


@kernel
def _minima(values):
    height, width = values.shape
    found = np.zeros((height, width), np.int32)
    seen = np.zeros((height, width), np.bool_)
    stack = np.empty(height * width, np.int64)
    count = 0
    for y0 in range(height):
        for x0 in range(width):
            if seen[y0, x0]:
                continue
            seen[y0, x0] = True
            level, lowest = values[y0, x0], True
            stack[0] = y0 * width + x0
            n, k = 1, 0
            while k < n:
                y, x = stack[k] // width, stack[k] % width
                k += 1
                for v, u in ((y - 1, x), (y, x - 1), (y, x + 1), (y + 1, x)):
                    if v < 0 or u < 0 or v >= height or u >= width:
                        continue
                    if values[v, u] < level:
                        lowest = False
                    elif values[v, u] == level and not seen[v, u]:
                        seen[v, u] = True
                        stack[n] = v * width + u
                        n += 1
            if lowest:
                count += 1
                for k in range(n):
                    found[stack[k] // width, stack[k] % width] = count
    return found


@kernel
def _flood(levels, labels):
    height, width = labels.shape
    # A binary heap of pixels by level and by age, the number of those that were reached before.
    heap, keys = np.empty(height * width, np.int32), np.empty(height * width, np.int64)
    size, born = 0, 0
    flat, level = labels.ravel(), levels.ravel()
    for y in range(height):
        for x in range(width):
            pixel = y * width + x
            if flat[pixel] != 0 and (
                (y > 0 and flat[pixel - width] == 0)
                or (x > 0 and flat[pixel - 1] == 0)
                or (x < width - 1 and flat[pixel + 1] == 0)
                or (y < height - 1 and flat[pixel + width] == 0)
            ):
                size = _push(heap, keys, size, pixel, (np.int64(level[pixel]) << 32) | born)
                born += 1
    while size:
        pixel = np.int64(heap[0])
        size = _pop(heap, keys, size)
        y, x = pixel // width, pixel % width
        for k in range(4):
            if k == 0:
                inside, other = y > 0, pixel - width
            elif k == 1:
                inside, other = x > 0, pixel - 1
            elif k == 2:
                inside, other = x < width - 1, pixel + 1
            else:
                inside, other = y < height - 1, pixel + width
            if inside and flat[other] == 0:
                flat[other] = flat[pixel]
                size = _push(heap, keys, size, other, (np.int64(level[other]) << 32) | born)
                born += 1


@kernel
def _push(heap, keys, size, pixel, key):
    k = size
    while k > 0:
        parent = (k - 1) // 2
        if keys[parent] < key:
            break
        heap[k], keys[k] = heap[parent], keys[parent]
        k = parent
    heap[k], keys[k] = pixel, key
    return size + 1


@kernel
def _pop(heap, keys, size):
    size -= 1
    pixel, key = heap[size], keys[size]
    k = 0
    while 2 * k + 1 < size:
        child = 2 * k + 1
        if child + 1 < size and keys[child + 1] < keys[child]:
            child += 1
        if key < keys[child]:
            break
        heap[k], keys[k] = heap[child], keys[child]
        k = child
    heap[k], keys[k] = pixel, key
    return size
