"""Colours of interior control points, predicted by those above and to the left.

Everything is a difference from what the boundary alone gives at a point, along the axes of the basis, in
sixteenths of a step; what is left of a prediction is stored in the point's own strides. Predictions from the
nearest known points of the patch, as they are and along several directions, are blended and corrected by a
linear model that learns what they miss. How large a difference may be, and of which sign, is told by the
differences nearby, and by those of the axes before.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.blending import blend, lean, look_back, sum_up
from gcvec.codec.colors import FRACTION, rounded
from gcvec.codec.echo import Echo, add_to, make_up
from gcvec.codec.integers import NODES, code_integer, sign, size_class
from gcvec.codec.mixing import Model, place_contexts
from gcvec.codec.neighborhoods import Neighborhoods
from gcvec.codec.prediction import FURTHEST, correction, learn, nearest_integer
from gcvec.codec.range_coder import Coder, rehearses
from gcvec.kernels import bare_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
SmallInts = NDArray[np.int32]

_BLENDED_SCALE = 5.0
"""Steps in a unit of the blended prediction as a feature: it is larger than others, which are differences."""

_BASE_WEIGHT = 455
"""Weight of no difference at all among neighbours, whose own is 2^16 over their square distance."""

_UNKNOWN_ACTIVITY = 16
"""How much colours are taken to change nearby where no neighbour is known yet."""

_BLOCK_BITS = 5
"""Blocks of 32 x 32 pixels are told apart, as far as there are contexts for them."""

_FEATURES = 11
_SIZE_CONTEXTS, _SIGN_CONTEXTS, _CONTEXT_SIZE = 6, 3, 512
_SELECTORS = 8
_AXIS_COUNTERS = (_SIZE_CONTEXTS + _SIGN_CONTEXTS) * _CONTEXT_SIZE * NODES
_AXIS_ROWS = _SELECTORS * NODES
POINT_COUNTERS, POINT_ROWS, POINT_INPUTS = 3 * _AXIS_COUNTERS, 3 * _AXIS_ROWS, _SIZE_CONTEXTS


class Surroundings(NamedTuple):
    """What is known around one point that has m neighbours at most.

    known      how many neighbours there are
    near       (m,) int32, which ones
    square     (m,) int32, their square distances
    share      (m,) float64, their weights in the best linear prediction
    leaning    (m, d) float64, their weights in the averages along each direction
    closeness  (m,) int64, 2^16 over their square distances
    average    (3,) int64, of their coordinates by closeness, in sixteenths of a step
    activity   (3,) int64, how far they are from their own predictions, in quarters of its own step
    spread     (3,) int64, how far they are from their average, in quarters of its own step
    """

    known: int
    near: SmallInts
    square: SmallInts
    share: Floats
    leaning: Floats
    closeness: Ints
    average: Ints
    activity: Ints
    spread: Ints


@kernel
def code_point_colors(
    coder: Coder,
    model: Model,
    points: Ints,
    patch: Ints,
    occupied: NDArray[np.uint8],
    around: Neighborhoods,
    along: Floats,
    strides: Ints,
    crowds: Ints,
    echo: Echo,
    wanted: Floats,
    result: Ints,
) -> None:
    """Write the coordinates `wanted` `(n, 3)`, in steps, of points `(n, 2)` by rows, or read them.

    Either way `result` `(n, 3)` becomes what a decoder sees, in sixteenths of a step. `patch` `(n,)` is the
    points' own, `occupied` `(h, w)` their bitmap, `around` their neighbourhoods, `along` the weights of
    points in averages along d directions, `strides` `(n,)` what differences count by, and `crowds` `(n,)`,
    0 to 31, says how dense points are around each. A writer makes up for the errors in the `echo`.
    """
    width, most, lanes = occupied.shape[1], around.near.shape[1], along.shape[2]
    closeness, leaning = np.zeros(most, np.int64), np.zeros((most, lanes))
    offers, errors = np.zeros(3 * (1 + lanes)), np.zeros((len(points), 3 * (1 + lanes)))
    sums = np.zeros(3 * (1 + lanes))
    differences = np.zeros(result.shape, np.int64)
    average, activity, spread = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3, np.int64)
    features, wish, off = np.zeros(_FEATURES + lanes), np.zeros(3), np.zeros(3)
    gain, power = np.zeros((3, _FEATURES + lanes)), np.ones((3, _FEATURES + lanes))
    for i in range(len(points)):
        nearby = Surroundings(
            around.known[i],
            around.near[i],
            around.square[i],
            around.share[i],
            leaning,
            closeness,
            average,
            activity,
            spread,
        )
        stride = strides[i]
        total = _survey(nearby, result, differences, stride)
        lean(points, nearby.near, nearby.known, i, along, leaning, sums[:lanes])
        _make_offers(nearby, result, offers)
        sum_up(nearby.near, closeness, total, nearby.known, errors, sums)
        x, y = points[i, 0], points[i, 1]
        pattern = _pattern(occupied, x, y)
        block = (y >> _BLOCK_BITS) * ((width >> _BLOCK_BITS) + 1) + (x >> _BLOCK_BITS)
        wish[:] = wanted[i]
        make_up(echo, i, wish)
        for axis in range(3):
            blended = blend(offers, sums, errors[i], total, axis)
            prediction = _predict(nearby, result, differences, i, axis, offers, blended, gain, features)
            if not rehearses(coder):
                _choose_sizes(
                    model, axis, nearby, differences[i], stride, block, pattern, crowds[i], patch[i]
                )
                _choose_signs(model, axis, nearby, result, differences, i, stride, patch[i], prediction)
            row = axis * _AXIS_ROWS + min(size_class(activity[axis]) >> 2, _SELECTORS - 1) * NODES
            offer = rounded((FRACTION * wish[axis] - prediction) / stride, activity[axis] / 4)
            difference = code_integer(coder, model, _SIZE_CONTEXTS, _SIGN_CONTEXTS, row, offer)
            differences[i, axis] = stride * difference
            learn(gain[axis], power[axis], features, differences[i, axis] / FRACTION)
            result[i, axis] = min(max(prediction + differences[i, axis], -FURTHEST), FURTHEST)
            off[axis] = result[i, axis] / FRACTION - wanted[i, axis]
            look_back(offers, result[i, axis] / FRACTION, errors[i], axis)
        add_to(echo, i, off)


@bare_kernel
def _survey(nearby: Surroundings, result: Ints, differences: Ints, stride: int) -> int:
    """Find out, for every axis, what the neighbours of a point of this stride are like. Returns how much they
    weigh by closeness."""
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
        nearby.activity[axis] = 4 * surprise // (total * stride) if nearby.known else _UNKNOWN_ACTIVITY
        nearby.spread[axis] = 4 * away // (total * stride)
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
def _make_offers(nearby: Surroundings, result: Ints, offers: Floats) -> None:
    """Predictions `offers` `(3 o,)` of each coordinate, in steps: the kriged one, and one for each
    direction."""
    lanes = len(offers) // 3
    offers[:] = 0.0
    for j in range(nearby.known):
        for axis in range(3):
            known, first = result[nearby.near[j], axis] / FRACTION, axis * lanes
            offers[first] += nearby.share[j] * known
            for k in range(1, lanes):
                offers[first + k] += nearby.leaning[j, k - 1] * known


@bare_kernel
def _predict(
    nearby: Surroundings,
    result: Ints,
    differences: Ints,
    i: int,
    axis: int,
    offers: Floats,
    blended: float,
    gain: Floats,
    features: Floats,
) -> int:
    """The prediction of one coordinate, in sixteenths of a step, and the `features` that the `blended` one is
    corrected by."""
    n, near, closeness = nearby.known, nearby.near, nearby.closeness
    features[:] = 0.0
    if n > 0:
        features[0] = result[near[0], axis] / FRACTION - blended
        features[1] = nearby.average[axis] / FRACTION - blended
        features[2] = differences[near[0], axis] / FRACTION
        features[3] = blended / _BLENDED_SCALE
    if n > 1:
        features[4] = differences[near[1], axis] / FRACTION
    for b in range(axis):
        # What axis b was off by, as it is, as it went along with this axis nearby, and as a slope.
        together, alone = 0, FRACTION**3
        for k in range(n):
            together += closeness[k] * differences[near[k], b] * differences[near[k], axis]
            alone += closeness[k] * differences[near[k], b] ** 2
        features[5 + b] = differences[i, b] / FRACTION
        features[7 + b] = together / alone * differences[i, b] / FRACTION
        features[9 + b] = (result[i, b] - (result[near[0], b] if n else 0)) / FRACTION
    lanes = len(offers) // 3
    for k in range(1, lanes):
        features[_FEATURES + k - 1] = offers[axis * lanes + k] - offers[axis * lanes]
    prediction: int = nearest_integer((blended + correction(gain[axis], features)) * FRACTION)
    return prediction


@bare_kernel
def _choose_sizes(
    model: Model,
    axis: int,
    nearby: Surroundings,
    own: Ints,
    stride: int,
    block: int,
    pattern: int,
    crowd: int,
    patch: int,
) -> None:
    """Choose the contexts for the size of a difference; `own` are the point's on the axes before."""
    before = 0
    for b in range(axis):
        before = abs(own[b]) // stride + before // 2
    before = min(size_class(4 * before) >> 1, 11)
    activity = nearby.activity
    whole = min(size_class(activity[0] + activity[1] + activity[2]) >> 1, 15)
    distance = min(size_class(nearby.square[0]), 15) if nearby.known > 0 else 15
    slots = model.slots
    slots[0] = block % _CONTEXT_SIZE
    slots[1] = whole * 12 + before
    slots[2] = min(size_class(nearby.spread[axis]), 27) * 16 + distance
    slots[3] = pattern
    slots[4] = crowd * 16 + distance
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
    stride: int,
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
    slots[6] = (256 if beyond > 0 else 0) + min(size_class(4 * abs(beyond) // stride), 255)
    slots[7] = (3 * sign(first) + sign(second)) * 9 + own
    slots[8] = min(patch, 54) * 9 + own
    last = _SIZE_CONTEXTS + _SIGN_CONTEXTS
    place_contexts(model, axis * _AXIS_COUNTERS, _SIZE_CONTEXTS, last, _CONTEXT_SIZE, NODES)
