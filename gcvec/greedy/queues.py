"""Which triangles are next, and how many: by what points would save there and what patches may still have."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.greedy.strip import TRIANGLES, Strip

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FALL = 1.2
"""New points take this much more from the error than each would alone: the others' colours adapt."""

SAVED = 0.6
"""Errors fall with about the power -1.5 of the number of points, so they go with this power of what the last
point saves."""

MOST_BETTER = 0.5
"""Patches that have room are not made better than this share of the error that all should have, for the sake
of those that have none."""


class Queue(NamedTuple):
    """Triangles of a strip where a point would save something.

    triangle  (q,) int64
    gain      (q,) squared error that the best point inside would save
    patch     (q,) int32
    rank      (q,) int64, how many of the same patch, in any strip, save more
    """

    triangle: Ints
    gain: Floats
    patch: NDArray[np.int32]
    rank: Ints

    def where(self, chosen: NDArray[np.bool_]) -> Queue:
        """Some of them."""
        return Queue(self.triangle[chosen], self.gain[chosen], self.patch[chosen], self.rank[chosen])


class FullPatches(NamedTuple):
    """Patches that may have no more points.

    square  (f,) their squared errors
    price   (f,) what the best further point in each would save
    area    the share of the picture that they cover
    """

    square: Floats
    price: Floats
    area: float

    def missing(self, error: float, goal: float, price: float) -> float:
        """How far the picture with that error is from the goal, if full patches had points down to this price
        as the others have; but the others need not be much better than the goal asks of all.
        """
        if not len(self.square):
            return error - goal
        share = np.minimum(price / np.maximum(self.price, 1e-300), 1.0)
        lack = float((self.square * (1 - share**SAVED)).sum())
        others = error - float(self.square.sum())
        return min(error - lack - goal, others - MOST_BETTER * goal * (1 - self.area))


NONE_FULL = FullPatches(np.zeros(0), np.zeros(0), 0.0)


def how_many(gain: Floats, missing: Callable[[float], float]) -> int:
    """How many points, in the order of what they save, `gain` `(n,)`, make up for what is missing at the
    price of the last one."""
    saved = FALL * np.cumsum(gain)
    low, high = 0, len(gain)
    while low < high:
        middle = (low + high) // 2
        low, high = (low, middle) if saved[middle] >= missing(float(gain[middle])) else (middle + 1, high)
    return low


def useful(strip: Strip) -> Queue:
    """All triangles of a strip where a point would save something."""
    gain = strip.gain[: strip.counts[TRIANGLES]]
    found = np.flatnonzero(gain > 0)
    return Queue(found, gain[found], strip.patch[found], np.zeros_like(found))
