"""The best picture that fits into so many bytes: a search for the error to aim at.

Bytes fall with a power of the error that is nearly the same from run to run, so the secant method on the
logarithms of both needs few runs.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from gcvec.errors import InputError

FIRST_MSE = 10.0
USUAL_POWER = -0.8
POWERS = -2.0, -0.3
"""Bytes go with this power of the error until two runs tell better, and never with one beyond these."""

CLOSE = 0.97
"""A file of at least this share of the bytes allowed is good enough."""

AIM = 0.985

MSE_RANGE = 0.2, 20_000.0

MOST_RUNS = 7


BETTER = 0.995
"""A larger file whose error is above this share of the last one's is no better: more bytes buy nothing."""


class Sized(Protocol):
    """A file and the mean squared error of its picture (0-255 scale)."""

    @property
    def data(self) -> bytes: ...

    @property
    def mse(self) -> float: ...


Result = TypeVar("Result", bound=Sized)


def refine_to_bytes(refine: Callable[[float], Result], target_bytes: int) -> Result:
    """The best file of at most `target_bytes` among those that `refine` makes for some targets of the mean
    squared error.

    Raises `InputError` where even the coarsest picture takes more.
    """
    best: Result | None = None
    mse, power = FIRST_MSE, USUAL_POWER
    before: tuple[float, int] | None = None
    tried: set[float] = set()
    for _ in range(MOST_RUNS):
        found = refine(mse)
        tried.add(mse)
        size = len(found.data)
        if size <= target_bytes:
            no_better = best is not None and size > len(best.data) and found.mse > BETTER * best.mse
            best = found if best is None or found.mse < best.mse else best
            if no_better or size >= CLOSE * target_bytes:
                break
        if before is not None and before[1] != size and before[0] != mse:
            power = np.log(size / before[1]) / np.log(mse / before[0])
        before = mse, size
        power = float(np.clip(power, *POWERS))
        mse = float(np.clip(mse * (AIM * target_bytes / size) ** (1 / power), *MSE_RANGE))
        if mse in tried:
            break
    coarsest = MSE_RANGE[1]
    if best is None and coarsest not in tried:
        found = refine(coarsest)
        size = len(found.data)
        best = found if size <= target_bytes else None
    if best is None:
        raise InputError(
            f"the picture does not fit into {target_bytes} bytes: its coarsest version takes {size}",
            code="bad-option",
            pointer="target_bytes",
        )
    return best
