"""The known points around an interior control point, which its colour is predicted from.

Simple kriging, the prediction of ordinary geostatistics, gives each of them its share.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel, kernel
from gcvec.parallel import in_shares

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
SmallInts = NDArray[np.int32]

NEIGHBORS = 10
"""A colour is predicted from so many points that are known, the nearest. All numbers here are part of the
format: others make other files."""

REACH = 48
"""Points further away than this, pixels, are no neighbours."""

_RANGE = 20.0
_NUGGET = 0.02
"""The covariance of points d pixels apart is 1 / (1 + d / 20), which is one in the plane since it is a
mixture of exponentials; each has noise of 0.02 on top."""


class Neighborhoods(NamedTuple):
    """The known points of the same patch nearest to each point when its turn comes, and how they count.

    known   (n,) int32, how many there are, at most m
    near    (n, m) int32, which ones, the nearest first
    square  (n, m) int32, their square distances
    share   (n, m) float64, their weights in the best linear prediction
    """

    known: SmallInts
    near: SmallInts
    square: SmallInts
    share: Floats


def neighborhoods(points: Ints, patch: Ints, height: int, width: int, most: int = NEIGHBORS) -> Neighborhoods:
    """Those of points `(n, 2)` by rows, of these patches `(n,)`, in a picture of that size: `most` points
    each."""
    number = np.full((height, width), -1, np.int32)
    number[points[:, 1], points[:, 0]] = np.arange(len(points))
    shape = len(points), most
    found = Neighborhoods(
        np.zeros(len(points), np.int32), np.zeros(shape, np.int32), np.zeros(shape, np.int32), np.zeros(shape)
    )
    in_shares(lambda first, last: _find(points, patch, number, first, last, found), len(points))
    return found


@kernel
def _find(points: Ints, patch: Ints, number: SmallInts, first: int, last: int, found: Neighborhoods) -> None:
    most = found.near.shape[1]
    covariance = np.zeros((most, most))
    for i in range(first, last):
        n = _nearest_known(points, patch, number, i, found.near[i], found.square[i])
        _krige(points, found.near[i], found.square[i], n, covariance, found.share[i])
        found.known[i] = n


@bare_kernel
def _nearest_known(
    points: Ints, patch: Ints, number: SmallInts, i: int, near: SmallInts, square: SmallInts
) -> int:
    """The points of the same patch before point i that are nearest to it, in order, and their square
    distances.

    `number` `(h, w)` says which point a pixel holds, -1: none. Squares of pixels around the point are
    searched from the inside out, each by its upper edge, then the left and right ones downwards. Returns how
    many were found.
    """
    width, most = number.shape[1], len(near)
    x, y = points[i, 0], points[i, 1]
    n = 0
    for ring in range(1, REACH + 1):
        if n == most and square[n - 1] <= ring * ring:
            break
        left, right = max(x - ring, 0), min(x + ring, width - 1)
        for row in range(max(y - ring, 0), y + 1):
            stride = 1
            if row > y - ring:
                # Only the edges; a stride from one to the other passes over what is inside.
                left, right, stride = x - ring, x + ring, 2 * ring
            for column in range(left, right + 1, stride):
                if not 0 <= column < width:
                    continue
                j = number[row, column]
                if not 0 <= j < i or patch[j] != patch[i]:
                    continue
                d = (column - x) ** 2 + (row - y) ** 2
                if n == most and d >= square[n - 1]:
                    continue
                k = min(n, most - 1)
                n = min(n + 1, most)
                while k > 0 and square[k - 1] > d:
                    near[k], square[k] = near[k - 1], square[k - 1]
                    k -= 1
                near[k], square[k] = j, d
    return n


@bare_kernel
def _krige(
    points: Ints, near: SmallInts, square: SmallInts, n: int, covariance: Floats, share: Floats
) -> None:
    """Weights `share` `(n,)` of the best linear prediction from the neighbours, by Cholesky's method.

    `covariance` `(n, n)` is scratch.
    """
    for a in range(n):
        for b in range(a):
            across, down = points[near[a], 0] - points[near[b], 0], points[near[a], 1] - points[near[b], 1]
            covariance[a, b] = _RANGE / (_RANGE + np.sqrt(float(across * across + down * down)))
        covariance[a, a] = 1.0 + _NUGGET
        share[a] = _RANGE / (_RANGE + np.sqrt(float(square[a])))
    for a in range(n):
        for b in range(a + 1):
            value = covariance[a, b]
            for k in range(b):
                value -= covariance[a, k] * covariance[b, k]
            covariance[a, b] = np.sqrt(value) if a == b else value / covariance[b, b]
    for a in range(n):
        for k in range(a):
            share[a] -= covariance[a, k] * share[k]
        share[a] /= covariance[a, a]
    for a in range(n - 1, -1, -1):
        for k in range(a + 1, n):
            share[a] -= covariance[k, a] * share[k]
        share[a] /= covariance[a, a]
