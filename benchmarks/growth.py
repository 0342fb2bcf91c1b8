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


def exponent(sizes: Sequence[float], values: Sequence[float]) -> float | None:
    """k of the power law size^k that fits best; None with fewer than two values."""
    if len(values) < 2:
        return None
    return float(np.polyfit(np.log(sizes), np.log(values), 1)[0])
