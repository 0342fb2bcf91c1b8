"""How good each part of a picture has to become next.

Points go where they buy most if a further one saves the same in every part. A part with n points has an error
of about E n^-k; E and k are known from how its error fell as it grew. So a further point saves k E n^-(k+1),
and at one such price the errors of all parts add up to what the picture aims at. It tells the error that each
part has to come to.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gcvec.parts.messages import PartResult

Floats = NDArray[np.float64]

USUAL_POWER = 1.0
POWERS = 0.4, 2.0
"""k, until a part has grown by the factor `TELLING`, and its bounds."""

TELLING = 1.5
"""k is learnt from numbers of points that differ by this factor at least."""

RANGE = 20.0
"""The logarithm of the common price is sought this far beyond those of the parts' prices."""

FARTHEST = 20.0
"""No part is sent to an error that differs by more than this factor from the one it has."""


def common_goals(states: Sequence[PartResult], aim: float) -> Floats:
    """`(parts,)` the squared errors that these parts come to at one price, and that add up to `aim`, without
    what their regions lack that are full.

    Parts that no points help, or that have none, stay as they are.
    """
    square = np.array([state.square - state.lack for state in states])
    n = np.array([len(state.points) for state in states])
    moving = np.array([state.more for state in states]) & (n > 0) & (square > 0)
    if not moving.any():
        return square
    power = np.array([_power(state.course) for state in states])
    price = power * square / np.maximum(n, 1)

    def at(common: float) -> Floats:
        factor = (common / np.maximum(price, 1e-300)) ** (power / (power + 1))
        return np.where(moving, square * np.clip(factor, 1 / FARTHEST, FARTHEST), square)

    low = float(np.log(price[moving].min())) - RANGE
    high = float(np.log(price[moving].max())) + RANGE
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (low, middle) if at(np.exp(middle)).sum() > aim else (middle, high)
    return at(np.exp(low))


def _power(course: Floats) -> float:
    """k of a part with this course `(k, 2)`, as its last growth tells it."""
    if not len(course):
        return USUAL_POWER
    n, square = np.log(np.maximum(course, 1e-300)).T
    apart = np.flatnonzero(np.abs(n[-1] - n) >= np.log(TELLING))
    if not len(apart):
        return USUAL_POWER
    begin = apart[-1]
    return float(np.clip((square[begin] - square[-1]) / (n[-1] - n[begin]), *POWERS))
