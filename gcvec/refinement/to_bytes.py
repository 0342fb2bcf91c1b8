"""The best picture that fits into so many bytes: a search for the error to aim at.

Bytes fall with a power of the error that changes but slowly, so the search goes along a line in the
logarithms of both: beyond what has been tried, then between the closest file that is too large and the
closest that fits.
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
"""A bound on the time: after so many the best file that fits is taken, unless it is poor."""

POOR = 0.5
"""The search goes on for as many runs again where others were too large and what fits takes less than this
share of the bytes allowed: for noise the first error to try is far off."""

BETTER = 0.995
"""A larger file whose error is above this share of the last one's is no better: more bytes buy nothing."""


class Sized(Protocol):
    """A file and the mean squared error of its picture (0-255 scale)."""

    @property
    def data(self) -> bytes: ...

    @property
    def mse(self) -> float: ...


class _Run(NamedTuple):
    """The error that was aimed at, and the bytes of the file that came of it."""

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
    mse, runs = _in_range(first_mse), list[_Run]()
    while mse not in [run.mse for run in runs]:
        found = refine(mse)
        size = len(found.data)
        runs.append(_Run(mse, size))
        if size <= target_bytes:
            no_better = best is not None and size > len(best.data) and found.mse > BETTER * best.mse
            best = found if best is None or found.mse < best.mse else best
            if (no_better and len(runs) <= MOST_RUNS) or size >= CLOSE * target_bytes:
                break
        too_large, fitting = _sides(runs, target_bytes)
        poor = bool(too_large) and best is not None and len(best.data) < POOR * target_bytes
        if len(runs) >= (2 * MOST_RUNS if poor else MOST_RUNS):
            break
        mse = _in_range(_next(runs, target_bytes))
        stuck = len(runs) >= MOST_RUNS or mse in [run.mse for run in runs]
        if poor and stuck:  # sizes say little: they may be all but the same over a wide range of errors
            mse = float(np.sqrt(max(run.mse for run in too_large) * min(run.mse for run in fitting)))
    coarsest = MSE_RANGE[1]
    if best is None and coarsest not in [run.mse for run in runs]:
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


def _sides(runs: list[_Run], target_bytes: int) -> tuple[list[_Run], list[_Run]]:
    """The runs whose files are too large, and those whose files fit."""
    too_large = [run for run in runs if run.size > target_bytes]
    return too_large, [run for run in runs if run.size <= target_bytes]


def _next(runs: list[_Run], target_bytes: int) -> float:
    """The error to try after these runs."""
    aim = AIM * target_bytes
    too_large, fitting = _sides(runs, target_bytes)
    if not too_large or not fitting:
        return _beyond(runs, aim)
    above, below = min(too_large, key=lambda run: run.size), max(fitting, key=lambda run: run.size)
    share = 0.5  # where one end stays for long, or sizes do not fall as they should
    on_one_side = len({run.size > target_bytes for run in runs[-3:]}) == 1
    if not on_one_side and above.mse < below.mse:
        share = np.log(above.size / aim) / np.log(above.size / below.size)
    return float(above.mse ** (1 - share) * below.mse**share)


def _beyond(runs: list[_Run], aim: float) -> float:
    """The error further on than those tried, at which the bytes would be those aimed at."""
    last, power = runs[-1], USUAL_POWER
    if len(runs) > 1 and runs[-2].size != last.size:
        power = np.log(last.size / runs[-2].size) / np.log(last.mse / runs[-2].mse)
    return float(last.mse * (aim / last.size) ** (1 / np.clip(power, *POWERS)))
