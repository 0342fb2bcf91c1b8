"""The steps of colours whose file comes closest to the error wanted.

The error that rounding adds goes with the square of the step. So a picture that is a little better than it
need be is stored in fewer bytes, and one that is not quite as good still reaches its target, without another
round of refinement.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from gcvec.quantization import Quantization

LEAST_SCALE, MOST_SCALE = 0.75, 1.25
"""How far steps may differ from the planned ones: beyond, more or fewer points are the better way."""

AIM = 0.9985
"""The share of the target to aim at: the error does not fall quite evenly with the steps."""

KEPT = 0.9999
"""An error of this share of the target is taken to keep it: a file's picture is computed more exactly."""

WORTH = 1.015
"""Steps that are larger by less than this factor are not worth another try."""

MOST_TRIES = 6
"""A bound on the time: each costs a prediction of all colours."""


def landing_steps(
    mse_in: Callable[[Quantization], float],
    planned: Quantization,
    before: float,
    rounding: float,
    target_mse: float,
) -> Quantization:
    """The largest colour steps, near the planned ones, in which the error `mse_in` them is `target_mse` or
    less.

    `before` is the error before rounding, and `rounding` what the planned steps are expected to add. Where no
    steps near the planned ones keep the target, the smallest tried; the planned ones where even exact colours
    would not.
    """
    if before >= target_mse:
        return planned

    def ideal(step: int, rounding: float) -> int:
        allowed = max(AIM * target_mse - before, 0.0)
        return round(step * math.sqrt(allowed / max(rounding, 1e-9)))

    most_kept = KEPT * target_mse
    least, most = math.ceil(LEAST_SCALE * planned.point_step), int(MOST_SCALE * planned.point_step)
    step = min(max(ideal(planned.point_step, rounding), least), most)
    tried: dict[Quantization, float] = {}
    while len(tried) < MOST_TRIES:
        steps = planned.scaled(step / planned.point_step)
        tried[steps] = mse = mse_in(steps)
        kept = mse <= most_kept
        least, most = (step + 1, most) if kept else (least, step - 1)
        step = min(ideal(step, mse - before), most)
        some_kept = any(one <= most_kept for one in tried.values())
        if least > most or (some_kept and step < WORTH * (least - 1)):
            break
        step = max(step, least)
    return max(tried, key=lambda one: one.point_step if tried[one] <= most_kept else -tried[one])
