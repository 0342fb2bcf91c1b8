"""What a running vectorization tells its caller."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from math import log
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcvec.refinement.scene import Iteration

BEFORE_RUNS, AFTER_RUNS = 0.1, 0.95
"""Shares of the work that are done when refinement begins and when it ends."""

GROWTH = 0.45
"""The share of a run that passes until its error is about right, if exchanges of points follow."""

EXCHANGED = 0.9
"""The share that has passed after them: colours are fitted once more, and a file is made."""


@dataclass(frozen=True)
class Progress:
    """One step of the pipeline; during refinement, one iteration.

    `phase` is "regions", "boundary", "mesh", "refine" or "encode". `region` is the region with the largest
    remaining error out of `regions`; `iteration` counts from 1 within "refine" (0 elsewhere); `points` is the
    number of interior control points of the picture; `worst_error` the largest absolute pixel error and `mse`
    the picture's mean squared error, both on the 0-255 scale (None before they are known); `fraction`
    estimates the share of the work done, 0 to 1, never falling.
    """

    phase: str
    region: int
    regions: int
    iteration: int
    points: int
    worst_error: float | None
    mse: float | None
    fraction: float


OnProgress = Callable[[Progress], None]
"""Called after every step. An exception raised by it ends the run: that is how a run is cancelled."""


class Teller:
    """Progress reports whose fraction never falls.

    iterations  of the run that goes on: in how many of them each region grew
    mse         the error that the last of them has come to, None before the first
    """

    def __init__(self, on_progress: OnProgress | None) -> None:
        self.regions = 0
        self.iterations: Counter[int] = Counter()
        self.mse: float | None = None
        self._on_progress = on_progress
        self._fraction = 0.0
        self._target_mse = 0.0
        self._first_mse: float | None = None
        self._exchanges: int | None = None
        self._growth = 1.0
        self._before, self._share = 0.0, 0.0

    def stage(self, phase: str, fraction: float) -> None:
        """A stage begins, with this share of the work done."""
        self._tell(phase, fraction)

    def run(self, target_mse: float, exchanges: bool, last: bool) -> None:
        """A run of refinement begins, with exchanges of points or without. While none is known to be the
        last, each gets half of what is left."""
        self.iterations, self.mse = Counter(), None
        self._target_mse, self._first_mse = target_mse, None
        self._exchanges, self._growth = None, GROWTH if exchanges else 1.0
        self._before = max(self._fraction, BEFORE_RUNS)
        self._share = (AFTER_RUNS - self._before) * (1 if last else 0.5)

    def iteration(self, made: Iteration) -> None:
        """A round has ended. Growth has come as far as the logarithm of the error says."""
        self.iterations.update(made.grown)
        self.mse = made.mse
        if made.left is None:
            first = self._first_mse = self._first_mse or max(made.mse, self._target_mse * 1.001)
            gone = log(first / max(made.mse, self._target_mse)) / log(first / self._target_mse)
            done = self._growth * min(max(gone, 0.0), 1.0)
        else:
            self._exchanges = self._exchanges or made.left + 1
            done = self._growth + (EXCHANGED - self._growth) * (1 - made.left / self._exchanges)
        self._tell(
            "refine",
            self._before + self._share * done,
            region=made.worst_region,
            iteration=made.number,
            points=made.points,
            worst_error=made.worst_error,
            mse=made.mse,
        )

    def done(self, points: int, mse: float) -> None:
        """All is done."""
        self._tell("encode", 1.0, points=points, mse=mse)

    def _tell(
        self,
        phase: str,
        fraction: float,
        region: int = 0,
        iteration: int = 0,
        points: int = 0,
        worst_error: float | None = None,
        mse: float | None = None,
    ) -> None:
        self._fraction = max(self._fraction, fraction)
        if self._on_progress:
            self._on_progress(
                Progress(phase, region, self.regions, iteration, points, worst_error, mse, self._fraction)
            )
