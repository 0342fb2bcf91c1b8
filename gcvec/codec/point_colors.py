"""Colours of interior control points, predicted by those above and to the left.

Everything is a difference from what the boundary alone gives at a point, along the axes of the basis, in
sixteenths of a step. The prediction is that of ordinary geostatistics, simple kriging from the nearest known
points of the patch, corrected by a linear model that learns what kriging misses. How large a difference may
be, and of which sign, is told by the differences nearby, and by those of the axes before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.colors import FRACTION, rounded
from gcvec.codec.integers import NODES, code_integer, sign, size_class
from gcvec.codec.mixing import Model, place_contexts
from gcvec.codec.prediction import FURTHEST, correction, learn, nearest_integer
from gcvec.codec.range_coder import Coder, rehearses
from gcvec.kernels import bare_kernel, kernel
from gcvec.parallel import in_shares

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_REACH = 48
_NEIGHBORS = 6
"""A colour is predicted from so many points that are known, the nearest, no further away than this, pixels.
All these numbers are part of the format: others make other files."""

_RANGE = 20.0
_NUGGET = 0.02
"""The covariance of points d pixels apart is 1 / (1 + d / 20), which is one in the plane since it is a
mixture of exponentials; each has noise of 0.02 on top."""

_KRIGED_SCALE = 5.0
"""Steps in a unit of the kriged value as a feature: it is larger than the others, which are differences."""

_BASE_WEIGHT = 455
"""Weight of no difference at all among neighbours, whose own is 2^16 over their square distance."""

_UNKNOWN_ACTIVITY = 16
"""How much colours are taken to change nearby where no neighbour is known yet."""

_DENSE_REACH = 3
"""Points within so many rows and columns tell how dense they are."""

_BLOCK_BITS = 5
"""Blocks of 32 x 32 pixels are told apart, as far as there are contexts for them."""

_FEATURES = 11
_SIZE_CONTEXTS, _SIGN_CONTEXTS, _CONTEXT_SIZE = 6, 3, 512
_SELECTORS = 8
_AXIS_COUNTERS = (_SIZE_CONTEXTS + _SIGN_CONTEXTS) * _CONTEXT_SIZE * NODES
_AXIS_ROWS = _SELECTORS * NODES
POINT_COUNTERS, POINT_ROWS, POINT_INPUTS = 3 * _AXIS_COUNTERS, 3 * _AXIS_ROWS, _SIZE_CONTEXTS


class Neighborhoods(NamedTuple):
    """The known points of the same patch nearest to each point when its turn comes, and how they count.

    known   (n,) int64, how many there are, at most 6
    near    (n, 6) int64, which ones, the nearest first
    square  (n, 6) int64, their square distances
    share   (n, 6) float64, their weights in the best linear prediction
    """

    known: Ints
    near: Ints
    square: Ints
    share: Floats


class Surroundings(NamedTuple):
    """What is known around one point.

    known      how many neighbours there are
    near       (6,) int64, which ones
    square     (6,) int64, their square distances
    share      (6,) float64, their weights in the best linear prediction
    closeness  (6,) int64, 2^16 over their square distances
    average    (3,) int64, of their coordinates by closeness, in sixteenths of a step
    activity   (3,) int64, how far they are from their own predictions, in quarters of a step
    spread     (3,) int64, how far they are from their average, in quarters of a step
    """

    known: int
    near: Ints
    square: Ints
    share: Floats
    closeness: Ints
    average: Ints
    activity: Ints
    spread: Ints


def neighborhoods(points: Ints, patch: Ints, height: int, width: int) -> Neighborhoods:
    """Those of points `(n, 2)` by rows, of these patches `(n,)`, in a picture of that size."""
    number = np.full((height, width), -1, np.int32)
    number[points[:, 1], points[:, 0]] = np.arange(len(points))
    shape = len(points), _NEIGHBORS
    found = Neighborhoods(
        np.zeros(len(points), np.int64), np.zeros(shape, np.int64), np.zeros(shape, np.int64), np.zeros(shape)
    )
    in_shares(lambda first, last: _find(points, patch, number, first, last, found), len(points))
    return found


@kernel
def _find(points, patch, number, first, last, found):
    covariance = np.zeros((_NEIGHBORS, _NEIGHBORS))
    for i in range(first, last):
        n = _nearest_known(points, patch, number, i, found.near[i], found.square[i])
        _krige(points, found.near[i], found.square[i], n, covariance, found.share[i])
        found.known[i] = n


@kernel
def code_point_colors(
    coder: Coder,
    model: Model,
    points: Ints,
    patch: Ints,
    occupied: NDArray[np.uint8],
    around: Neighborhoods,
    wanted: Floats,
    result: Ints,
) -> None:
    """Write the coordinates `wanted` `(n, 3)`, in steps, of points `(n, 2)` by rows, or read them.

    Either way `result` `(n, 3)` becomes what a decoder sees, in sixteenths of a step. `patch` `(n,)` is the
    points' own, `occupied` `(h, w)` their bitmap, `around` their neighbourhoods.
    """
    width = occupied.shape[1]
    closeness = np.zeros(_NEIGHBORS, np.int64)
    differences = np.zeros(result.shape, np.int64)
    average, activity, spread = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3, np.int64)
    features, gain, power = np.zeros(_FEATURES), np.zeros((3, _FEATURES)), np.ones((3, _FEATURES))
    for i in range(len(points)):
        nearby = Surroundings(
            around.known[i],
            around.near[i],
            around.square[i],
            around.share[i],
            closeness,
            average,
            activity,
            spread,
        )
        _survey(nearby, result, differences)
        x, y = points[i, 0], points[i, 1]
        dense, pattern = min(_count(occupied, x, y) // 3, 15), _pattern(occupied, x, y)
        block = (y >> _BLOCK_BITS) * ((width >> _BLOCK_BITS) + 1) + (x >> _BLOCK_BITS)
        for axis in range(3):
            prediction = _predict(nearby, result, differences, i, axis, gain, features)
            if not rehearses(coder):
                _choose_sizes(model, axis, nearby, differences[i], block, pattern, dense, patch[i])
                _choose_signs(model, axis, nearby, result, differences, i, patch[i], prediction)
            row = axis * _AXIS_ROWS + min(size_class(activity[axis]) >> 2, _SELECTORS - 1) * NODES
            offer = rounded(wanted[i, axis] - prediction / FRACTION, activity[axis] / 4)
            difference = code_integer(coder, model, _SIZE_CONTEXTS, _SIGN_CONTEXTS, row, offer)
            learn(gain[axis], power[axis], features, difference)
            differences[i, axis] = difference
            result[i, axis] = min(max(prediction + FRACTION * difference, -FURTHEST), FURTHEST)


@bare_kernel
def _nearest_known(
    points: Ints, patch: Ints, number: NDArray[np.int32], i: int, near: Ints, square: Ints
) -> int:
    """The points of the same patch before point i that are nearest to it, in order, and their square
    distances.

    `number` `(h, w)` says which point a pixel holds, -1: none. Squares of pixels around the point are
    searched from the inside out, each by its upper edge, then the left and right ones downwards. Returns how
    many were found.
    """
    width = number.shape[1]
    x, y = points[i, 0], points[i, 1]
    n = 0
    for ring in range(1, _REACH + 1):
        if n == _NEIGHBORS and square[n - 1] <= ring * ring:
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
                if n == _NEIGHBORS and d >= square[n - 1]:
                    continue
                k = min(n, _NEIGHBORS - 1)
                n = min(n + 1, _NEIGHBORS)
                while k > 0 and square[k - 1] > d:
                    near[k], square[k] = near[k - 1], square[k - 1]
                    k -= 1
                near[k], square[k] = j, d
    return n


@bare_kernel
def _krige(points: Ints, near: Ints, square: Ints, n: int, covariance: Floats, share: Floats) -> None:
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


@bare_kernel
def _survey(nearby: Surroundings, result: Ints, differences: Ints) -> None:
    """Find out, for every axis, what the neighbours are like."""
    near, closeness = nearby.near, nearby.closeness
    total = _BASE_WEIGHT
    for k in range(nearby.known):
        closeness[k] = (1 << 16) // nearby.square[k]
        total += closeness[k]
    for axis in range(3):
        weighted, surprise, away = 0, 0, 0
        for k in range(nearby.known):
            weighted += closeness[k] * result[near[k], axis]
            surprise += closeness[k] * abs(differences[near[k], axis])
        average = weighted // total
        for k in range(nearby.known):
            away += closeness[k] * abs(result[near[k], axis] - average)
        nearby.average[axis] = average
        nearby.activity[axis] = 4 * surprise // total if nearby.known else _UNKNOWN_ACTIVITY
        nearby.spread[axis] = away // (total * (FRACTION // 4))


@bare_kernel
def _count(occupied: NDArray[np.uint8], x: int, y: int) -> int:
    """How many of the pixels around (x, y), of 7 x 7, are control points, known or to come."""
    height, width = occupied.shape
    total = 0
    for row in range(max(y - _DENSE_REACH, 0), min(y + _DENSE_REACH + 1, height)):
        for column in range(max(x - _DENSE_REACH, 0), min(x + _DENSE_REACH + 1, width)):
            total += occupied[row, column]
    return total


@bare_kernel
def _pattern(occupied: NDArray[np.uint8], x: int, y: int) -> int:
    """Which of the eight pixels that touch (x, y) are control points: a bit each, by rows, first highest."""
    height, width = occupied.shape
    pattern = 0
    for row in range(y - 1, y + 2):
        for column in range(x - 1, x + 2):
            if row != y or column != x:
                pattern *= 2
                if 0 <= row < height and 0 <= column < width:
                    pattern += occupied[row, column]
    return pattern


@bare_kernel
def _predict(
    nearby: Surroundings, result: Ints, differences: Ints, i: int, axis: int, gain: Floats, features: Floats
) -> int:
    """The prediction of one coordinate, in sixteenths of a step, and the `features` it is corrected by."""
    n, near, closeness = nearby.known, nearby.near, nearby.closeness
    kriged = 0.0
    for k in range(n):
        kriged += nearby.share[k] * result[near[k], axis]
    kriged /= FRACTION
    features[:] = 0.0
    if n > 0:
        features[0] = result[near[0], axis] / FRACTION - kriged
        features[1] = nearby.average[axis] / FRACTION - kriged
        features[2] = differences[near[0], axis]
        features[3] = kriged / _KRIGED_SCALE
    if n > 1:
        features[4] = differences[near[1], axis]
    for b in range(axis):
        # What axis b was off by, as it is, as it went along with this axis nearby, and as a slope.
        together, alone = 0, FRACTION
        for k in range(n):
            together += closeness[k] * differences[near[k], b] * differences[near[k], axis]
            alone += closeness[k] * differences[near[k], b] ** 2
        features[5 + b] = differences[i, b]
        features[7 + b] = together / alone * differences[i, b]
        features[9 + b] = (result[i, b] - (result[near[0], b] if n else 0)) / FRACTION
    prediction: int = nearest_integer((kriged + correction(gain[axis], features)) * FRACTION)
    return prediction


@bare_kernel
def _choose_sizes(
    model: Model,
    axis: int,
    nearby: Surroundings,
    own: Ints,
    block: int,
    pattern: int,
    dense: int,
    patch: int,
) -> None:
    """Choose the contexts for the size of a difference; `own` are the point's on the axes before."""
    before = 0
    for b in range(axis):
        before = abs(own[b]) + before // 2
    before = min(size_class(4 * before) >> 1, 11)
    activity = nearby.activity
    whole = min(size_class(activity[0] + activity[1] + activity[2]) >> 1, 15)
    distance = min(size_class(nearby.square[0]), 15) if nearby.known > 0 else 15
    slots = model.slots
    slots[0] = block % _CONTEXT_SIZE
    slots[1] = whole * 12 + before
    slots[2] = min(size_class(nearby.spread[axis]), 27) * 16 + distance
    slots[3] = pattern
    slots[4] = dense * 16 + distance
    slots[5] = min(patch, 63) * 6 + before // 2
    place_contexts(model, axis * _AXIS_COUNTERS, 0, _SIZE_CONTEXTS, _CONTEXT_SIZE, NODES)


@bare_kernel
def _choose_signs(
    model: Model,
    axis: int,
    nearby: Surroundings,
    result: Ints,
    differences: Ints,
    i: int,
    patch: int,
    prediction: int,
) -> None:
    """Choose the contexts for the sign of a difference: where the nearest point is, and other signs."""
    n, near = nearby.known, nearby.near
    first = differences[near[0], axis] if n > 0 else 0
    second = differences[near[1], axis] if n > 1 else 0
    beyond = (result[near[0], axis] if n > 0 else 0) - prediction
    own = 0
    for b in range(axis):
        own += (3 if b == 0 else 1) * sign(differences[i, b])
    slots = model.slots
    slots[6] = (256 if beyond > 0 else 0) + min(size_class(abs(beyond) >> 2), 255)
    slots[7] = (3 * sign(first) + sign(second)) * 9 + own
    slots[8] = min(patch, 54) * 9 + own
    last = _SIZE_CONTEXTS + _SIGN_CONTEXTS
    place_contexts(model, axis * _AXIS_COUNTERS, _SIZE_CONTEXTS, last, _CONTEXT_SIZE, NODES)
