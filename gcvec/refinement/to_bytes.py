"""The best picture that fits into so many bytes: a search for the error to aim at.

Bytes fall with a power of the error that changes but slowly, so the search goes along a line in the
logarithms of both: beyond what has been tried, then between the closest file that is too large and the
closest that fits. The errors are those of the files: what was aimed at may have been out of reach, with noise
by far.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeVar

import numpy as np

from gcvec.errors import InputError

USUAL_MSE = 5.0
POINTS_A_BYTE = 0.5
"""What a picture takes is guessed from the control points that it is expected to need for this error: a byte
for so many. On photos the error that comes of it is within a factor of three of the one that fits."""

USUAL_POWER = -0.8
POWERS = -2.0, -0.3
"""Bytes go with this power of the error until two runs tell better, and never with one beyond these, which
files of nearly the same size could pretend. On two photos it was -0.6 to -1.0 between errors of 5 and 40, the
steeper the larger the error."""

CLOSE = 0.97
"""A file of at least this share of the bytes allowed is good enough."""

AIM = 0.985
"""The share of the bytes allowed that runs aim at: in the middle between `CLOSE` and too many."""

MSE_RANGE = 0.2, 20_000.0
"""Errors to aim at: from little more than rounding pixels to 8 bits adds, 1/12, to more than one colour for
all of a picture leaves, which is 127.5² at most."""

MOST_RUNS = 7
POOR = 0.8
"""A bound on the time: after so many runs the best file that fits is taken; after twice as many, where others
were too large and it takes less than this share of the bytes allowed: noise falls to next to nothing at once.
"""

BETTER = 0.995
"""A larger file whose error is above this share of the last one's is no better: more bytes buy nothing."""


class Sized(Protocol):
    """A file and the mean squared error of its picture (0-255 scale)."""

    @property
    def data(self) -> bytes: ...

    @property
    def mse(self) -> float: ...


class _Run(NamedTuple):
    """The error of a file and its bytes. One that is too large counts as what was aimed at, where that is the
    larger error: to aim lower would be in vain."""

    mse: float
    size: int


Result = TypeVar("Result", bound=Sized)


def likely_mse(expected_points: float, target_bytes: int) -> float:
    """The error to try first, for a picture of which so many control points are expected at `USUAL_MSE`."""
    usual_bytes = max(expected_points, 1.0) / POINTS_A_BYTE
    return _in_range(USUAL_MSE * (target_bytes / usual_bytes) ** (1 / USUAL_POWER))


def refine_to_bytes(refine: Callable[[float], Result], target_bytes: int, first_mse: float) -> Result:
    """The best file of at most `target_bytes` among those that `refine` makes for some targets of the mean
    squared error, `first_mse` being the first.

    Raises `InputError` where even the coarsest picture takes more.
    """
    best: Result | None = None
    aim, aims, runs = _in_range(first_mse), list[float](), list[_Run]()
    while aim not in aims and len(runs) < _most_runs(runs, target_bytes):
        found = refine(aim)
        aims.append(aim)
        size = len(found.data)
        fits = size <= target_bytes
        runs.append(_Run(found.mse if fits else max(aim, found.mse), size))
        if fits:
            no_better = best is not None and size > len(best.data) and found.mse > BETTER * best.mse
            best = found if best is None or found.mse < best.mse else best
            if no_better or size >= CLOSE * target_bytes:
                break
        aim = _in_range(_next(runs, target_bytes))
    coarsest = MSE_RANGE[1]
    if best is None and coarsest not in aims:
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


def _in_range(mse: float) -> float:
    return float(np.clip(mse, *MSE_RANGE))


def _most_runs(runs: list[_Run], target_bytes: int) -> int:
    """How many runs there may be after these."""
    fitting = [run.size for run in runs if run.size <= target_bytes]
    poor = 0 < len(fitting) < len(runs) and max(fitting) < POOR * target_bytes
    return 2 * MOST_RUNS if poor else MOST_RUNS


def _next(runs: list[_Run], target_bytes: int) -> float:
    """The error to aim at after these runs."""
    aim = AIM * target_bytes
    too_large = [run for run in runs if run.size > target_bytes]
    fitting = [run for run in runs if run.size <= target_bytes]
    if not too_large or not fitting:
        return _beyond(runs, aim)
    above, below = max(too_large), min(fitting)
    share = 0.5  # where one end stays, or sizes do not fall as they should
    on_one_side = len({run.size > target_bytes for run in runs[-2:]}) == 1
    if not on_one_side and above.mse < below.mse:
        share = np.log(above.size / aim) / np.log(above.size / below.size)
    return float(above.mse ** (1 - share) * below.mse**share)


def _beyond(runs: list[_Run], aim: float) -> float:
    """The error further on than those tried, at which the bytes would be those aimed at."""
    last, power = runs[-1], USUAL_POWER
    if len(runs) > 1 and runs[-2].size != last.size and runs[-2].mse != last.mse:
        power = np.log(last.size / runs[-2].size) / np.log(last.mse / runs[-2].mse)
    return float(last.mse * (aim / last.size) ** (1 / np.clip(power, *POWERS)))
