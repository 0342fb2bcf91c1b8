"""Error-driven interior control points (paper, section 4.4): which rounds there are.

Points are added until the picture is nearly good enough; then the least useful go, and others come where they
buy more; at the end the file is brought to the target as closely as it pays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.canonical import Foundation
from gcvec.draft import Draft, measured_mse
from gcvec.refinement import GROWTH, LEAST_SPARE, Refinement, Start, Step
from gcvec.timing import StageClock
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]

LANDING = 0.15
"""At the end no more than this share of the points is taken out to land on the target; with little effort
none."""

RETRIES = 4


class Effort(NamedTuple):
    """What is done for fewer points.

    growth     times as many points as there are, at most, that a round of growth adds: in smaller rounds
               they go where the error still is
    exchanges  shares of the points that later rounds take out, and place anew as far as the target asks for
               it
    """

    growth: float
    exchanges: tuple[float, ...]


EFFORTS = {
    1: Effort(6.0, ()),
    2: Effort(GROWTH, ()),
    3: Effort(GROWTH, (0.2,)),
    4: Effort(GROWTH, (0.15, 0.1)),
    5: Effort(GROWTH, (0.2, 0.1)),
    6: Effort(GROWTH, (0.2, 0.15, 0.1, 0.1)),
    7: Effort(GROWTH, (0.25, 0.2, 0.2, 0.15, 0.1, 0.1)),
    8: Effort(GROWTH, (0.3, 0.25, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1)),
    9: Effort(GROWTH, (0.3, 0.25, 0.25, 0.2, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.05)),
}

FEW = 10_000
MORE_EXCHANGES = (0.15, 0.1)
"""With so few points exchanges take next to no time, and there are more of them: not at the least effort."""


def refine_batch(
    foundation: Foundation,
    boundary_colors: Floats,
    pixels: NDArray[np.uint8],
    photo: NDArray[np.float32],
    draft: Draft,
    target_mse: float,
    max_points: int,
    effort: int,
    on_step: Callable[[Step], None],
    clock: StageClock,
    start: Start | None = None,
) -> tuple[bytes, VectorImage]:
    """The file, and what it holds, whose picture has the error `target_mse` (0-255 scale) or less.

    `pixels` is the photo `(h, w, 3)`, and `photo` the same in [0, 1]. `max_points` bounds the points of one
    region, 0 lifts the bound.
    `effort`, 1 to 9, trades time for fewer points. `start` is there where the rounds up to the last
    exchange have been done.
    """
    state = Refinement(
        foundation, boundary_colors, photo, target_mse, draft.steps, max_points, on_step, clock, start
    )

    def filed() -> tuple[bytes, VectorImage, float]:
        with clock.stage("encode"):
            data, image = draft.file(state.canvas, state.points, state.colors)
            return data, image, measured_mse(image, pixels)

    more = True
    if start is None:
        state.seed()
        more = state.grow(EFFORTS[effort].growth)
        shares = exchanges(effort, len(state.points))
        if shares:
            _, _, mse = filed()
            state.learn(mse)
        for share in shares:
            more = state.turn_over(share)
    state.settle()
    data, image, mse = filed()
    for attempt in range(RETRIES):
        state.learn(mse)
        if mse > target_mse and more:
            more = state.catch_up()
        elif attempt == 0 and EFFORTS[effort].exchanges and state.spare > LEAST_SPARE:
            more = state.turn_over(min(state.spare, LANDING))
        else:
            break
        state.settle()
        data, image, mse = filed()
    return data, image


def exchanges(effort: int, points: int) -> tuple[float, ...]:
    """The shares that an effort means for a picture that has grown to so many points."""
    shares = EFFORTS[effort].exchanges
    return shares + MORE_EXCHANGES if shares and points < FEW else shares
