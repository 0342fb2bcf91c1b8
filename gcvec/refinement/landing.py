"""The file that comes closest to the error wanted: the same colours, in somewhat larger or smaller steps.

The error that rounding adds goes with the square of the step. So a picture that is a little better than it
need be is stored in fewer bytes, and one that is not quite as good still reaches its target, without another
round of refinement.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from gcvec.quantization import Quantization
from gcvec.refinement.draft import Draft

LEAST_SCALE, MOST_SCALE = 0.75, 1.25
"""How far steps may differ from the planned ones: beyond, more or fewer points are the better way."""

AIM = 0.997
"""The share of the target to aim at: the error does not fall quite evenly with the steps."""

WORTH = 1.02
"""Steps that are larger by less than this factor are not worth making another file."""

MOST_FILES = 4
"""A bound on the time: each file costs a coding, and a drawing of what a decoder sees."""


def landed(
    file: Callable[[Quantization], Draft],
    planned: Quantization,
    before: float,
    rounding: float,
    target_mse: float,
) -> Draft:
    """The file with the largest colour steps, near the planned ones, whose error is `target_mse` or less.

    `before` is the error before rounding, and `rounding` what the planned steps are expected to add. Where no
    steps near the planned ones keep the target, the file with the smallest; in the planned ones where even
    exact colours would not.
    """
    if before >= target_mse:
        return file(planned)

    def in_steps_of(step: int) -> Draft:
        return file(planned.scaled(step / planned.point_step))

    def ideal(step: int, rounding: float) -> int:
        allowed = max(AIM * target_mse - before, 0.0)
        return round(step * math.sqrt(allowed / max(rounding, 1e-9)))

    least, most = math.ceil(LEAST_SCALE * planned.point_step), int(MOST_SCALE * planned.point_step)
    files = [in_steps_of(min(max(ideal(planned.point_step, rounding), least), most))]
    while len(files) < MOST_FILES:
        step, kept = files[-1].steps.point_step, files[-1].mse <= target_mse
        least, most = (step + 1, most) if kept else (least, step - 1)
        step = min(ideal(step, files[-1].mse - before), most)
        some_kept = any(one.mse <= target_mse for one in files)
        if least > most or (some_kept and step < WORTH * (least - 1)):
            break
        files.append(in_steps_of(max(step, least)))
    return min(files, key=lambda one: (one.mse > target_mse, abs(one.mse - target_mse)))
