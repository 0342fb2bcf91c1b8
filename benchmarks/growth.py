"""How time and memory grow with the picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from benchmarks.engine import vectorized
from benchmarks.run import Outcome, Run


def grown(run: Run, name: str, sizes: Sequence[float], target_mse: float) -> list[tuple[float, Outcome]]:
    """One picture vectorized at several sizes, megapixels."""
    return [
        (size, run.measure(vectorized, name=name, megapixels=size, target_mse=target_mse)) for size in sizes
    ]


def exponent(sizes: Sequence[float], values: Sequence[float], least: float = 0.0) -> float | None:
    """k of the power law size^k that fits best the values above `least`; None with fewer than two of them."""
    measured = [(size, value) for size, value in zip(sizes, values, strict=True) if value > least]
    if len(measured) < 2:
        return None
    logarithms = np.log(measured)
    return float(np.polyfit(logarithms[:, 0], logarithms[:, 1], 1)[0])
