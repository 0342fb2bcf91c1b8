"""What a running vectorization tells its caller."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


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
