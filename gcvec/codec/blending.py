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
NOT_ALONG = ALONG[..., :0].copy()
"""The weights of points in the averages along all directions, and along none."""


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
def blend(
    offers: Floats,
    near: SmallInts,
    closeness: Ints,
    total: int,
    n: int,
    errors: Floats,
    i: int,
    axis: int,
    sums: Floats,
) -> float:
    """The predictions `offers` `(o,)` of a coordinate of point i in one.

    Each has the weight of 1 over the fourth power of how large its square `errors` `(points, 3, o)` have
    been: at its n neighbours, by their `closeness`, and at the point itself on the axes before. `total` is
    the weight of the neighbours; `sums` `(o,)` is scratch.
    """
    if len(offers) == 1:
        only: float = offers[0]
        return only
    sums[:] = _FLOOR + _FLOOR_BY_WEIGHT * total
    for j in range(n):
        for k in range(len(offers)):
            sums[k] += closeness[j] * errors[near[j], axis, k]
    for b in range(axis):
        for k in range(len(offers)):
            sums[k] += _OWN * total * errors[i, b, k]
    blended, weights = 0.0, 0.0
    for k in range(len(offers)):
        square = sums[k] * sums[k]
        weight = 1.0 / (square * square)
        blended += weight * offers[k]
        weights += weight
    return blended / weights


@bare_kernel
def look_back(offers: Floats, found: float, errors: Floats, i: int, axis: int) -> None:
    """Note the square `errors` of the predictions `offers` of what turned out to be `found`."""
    for k in range(len(offers)):
        error = (found - offers[k]) ** 2
        errors[i, axis, k] = error + _FIRST_AXIS * errors[i, 0, k] if axis > 0 else error
