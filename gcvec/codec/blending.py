"""Several predictions of a colour, blended by how good each has been nearby.

The first takes the known points around as they are. The others are averages that reach further along one
direction than across it, since textures and edges have one. Blending predictors by their errors nearby is due
to Seemann and Tischer ("Generalized locally adaptive DPCM", 1997).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.neighborhoods import REACH
from gcvec.kernels import bare_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
SmallInts = NDArray[np.int32]

_DIRECTIONS = (1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1)
"""Averages reach along these vectors. All numbers here are part of the format: others make other files."""

_ACROSS = 4
"""How many times as much a distance across a direction counts as one along it."""

_FLOOR, _FLOOR_BY_WEIGHT = 1500.0, 0.2
"""What is added to the errors nearby, at all and for each unit of their weight: small ones tell little."""

_OWN = 0.1
"""What the errors at the point itself, on the axes before, weigh for each unit of all neighbours' weight."""

_FIRST_AXIS = 0.1
"""How much errors on the first axis count among those on each of the others."""


def _weights() -> Floats:
    """`(REACH + 1, 2 REACH + 1, d)`: what a point weighs in each average that is so many rows above and,
    from `REACH` to the left on, so many columns to the right."""
    down, across = np.mgrid[0 : -REACH - 1 : -1, -REACH : REACH + 1][..., None]
    a, b = np.array(_DIRECTIONS).T
    square = (a * across + b * down) ** 2 + (_ACROSS * (a * down - b * across)) ** 2
    return np.asarray(1 / np.maximum(square, 1))


ALONG = _weights()
"""The weights of points in the averages along all directions."""


@bare_kernel
def lean(points: Ints, near: SmallInts, n: int, i: int, along: Floats, leaning: Floats, sums: Floats) -> None:
    """Weights `leaning` `(m, d)` of the n neighbours of point i in each average `along` a direction.

    `sums` `(d,)` is scratch.
    """
    lanes = along.shape[2]
    sums[:] = 0.0
    for j in range(n):
        up, across = points[i, 1] - points[near[j], 1], points[near[j], 0] - points[i, 0]
        for k in range(lanes):
            leaning[j, k] = along[up, across + REACH, k]
            sums[k] += leaning[j, k]
    for k in range(lanes):
        sums[k] = 1.0 / sums[k] if n > 0 else 0.0
    for j in range(n):
        for k in range(lanes):
            leaning[j, k] *= sums[k]


@bare_kernel
def sum_up(near: SmallInts, closeness: Ints, total: int, n: int, errors: Floats, sums: Floats) -> None:
    """What the square errors of each prediction of each coordinate `(3 o,)` come to at the n neighbours, by
    their `closeness`, which comes to `total`. `errors` `(points, 3 o)` are those noted so far."""
    sums[:] = _FLOOR + _FLOOR_BY_WEIGHT * total
    for j in range(n):
        for k in range(len(sums)):
            sums[k] += closeness[j] * errors[near[j], k]


@bare_kernel
def blend(offers: Floats, sums: Floats, own: Floats, total: int, axis: int) -> float:
    """The predictions of a coordinate, among those of all three `(3 o,)`, in one.

    Each has the weight of 1 over the fourth power of its errors: those nearby, `sums` `(3 o,)`, and the
    point's `own` `(3 o,)` on the axes before, which count by the weight of the neighbours, `total`.
    """
    lanes = len(offers) // 3
    first = axis * lanes
    blended, weights = 0.0, 0.0
    for k in range(lanes):
        error = sums[first + k]
        for b in range(axis):
            error += _OWN * total * own[b * lanes + k]
        square = error * error
        weight = 1.0 / (square * square)
        blended += weight * offers[first + k]
        weights += weight
    return blended / weights if lanes > 1 else offers[first]


@bare_kernel
def look_back(offers: Floats, found: float, own: Floats, axis: int) -> None:
    """Note in `own` `(3 o,)` the square errors of a coordinate's predictions, among those of all three
    `(3 o,)`, now that it has been `found`."""
    lanes = len(offers) // 3
    for k in range(lanes):
        error = (found - offers[axis * lanes + k]) ** 2
        own[axis * lanes + k] = error + _FIRST_AXIS * own[k] if axis > 0 else error
