"""The best picture that fits into so many bytes: a search for the error to aim at.

Bytes fall with a power of the error that is nearly the same from run to run, so the secant method on the
logarithms of both needs few runs.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gcvec.errors import InputError
from gcvec.vector_image import VectorImage

FIRST_MSE = 10.0
USUAL_POWER = -0.8
POWERS = -2.0, -0.3
"""Bytes go with this power of the error until two runs tell better, and never with one beyond these."""

CLOSE = 0.97
"""A file of at least this share of the bytes allowed is good enough."""

AIM = 0.985

MSE_RANGE = 0.2, 20_000.0

MOST_RUNS = 7


def refine_to_bytes(
    refine: Callable[[float], tuple[bytes, VectorImage]], target_bytes: int
) -> tuple[bytes, VectorImage]:
    """The largest file, and what it holds, of at most `target_bytes` that `refine` makes for some target of
    the mean squared error.

    Raises `InputError` where even the coarsest picture takes more.
    """
    best: tuple[bytes, VectorImage] | None = None
    mse, power = FIRST_MSE, USUAL_POWER
    before: tuple[float, int] | None = None
    for _ in range(MOST_RUNS):
        data, image = refine(mse)
        size = len(data)
        if size <= target_bytes and (best is None or size > len(best[0])):
            best = data, image
        if best is not None and len(best[0]) >= CLOSE * target_bytes:
            break
        if before is not None and before[1] != size and before[0] != mse:
            power = np.log(size / before[1]) / np.log(mse / before[0])
        before = mse, size
        power = float(np.clip(power, *POWERS))
        wanted = float(np.clip(mse * (AIM * target_bytes / size) ** (1 / power), *MSE_RANGE))
        if wanted == mse:
            break
        mse = wanted
    coarsest = MSE_RANGE[1]
    if best is None and mse != coarsest:
        data, image = refine(coarsest)
        size = len(data)
        best = (data, image) if size <= target_bytes else None
    if best is None:
        raise InputError(
            f"the picture does not fit into {target_bytes} bytes: its coarsest version takes {size}",
            code="bad-option",
            pointer="target_bytes",
        )
    return best
