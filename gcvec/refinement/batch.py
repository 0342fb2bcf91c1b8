"""Error-driven interior control points (paper, section 4.4): which rounds there are.

Points are added until the picture is nearly good enough; then the least useful go, and others come where they
buy more; at the end colours are stored in the steps that bring the file to the target.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from gcvec.codec.file import rounded_colors
from gcvec.quantization import Quantization
from gcvec.refinement.draft import Draft, drafted, image_of
from gcvec.refinement.landing import landing_steps
from gcvec.refinement.rounding import Rounding, lacks_little
from gcvec.refinement.scene import Iteration, Scene, Start, Terms
from gcvec.refinement.state import FEW, GROWTH, LEAST_SPARE, Refinement
from gcvec.timing import StageClock

LANDING = 0.15
"""If a picture is far better than it need be, no more than this share of the points is taken out at the end;
with little effort none."""

BARE = 2.0
"""A file without points is tried first where the error, before its colours have converged, is at most this
many times the target: seeds would overshoot."""

RETRIES = 4
"""How often points are added again to a picture that no steps bring to its target."""


class Effort(NamedTuple):
    """What is done for a smaller file.

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
    3: Effort(GROWTH, (0.1,)),
    4: Effort(GROWTH, (0.2,)),
    5: Effort(GROWTH, (0.15, 0.1)),
    6: Effort(GROWTH, (0.2, 0.15, 0.1)),
    7: Effort(GROWTH, (0.25, 0.2, 0.2, 0.15, 0.1, 0.1)),
    8: Effort(GROWTH, (0.3, 0.25, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1)),
    9: Effort(GROWTH, (0.3, 0.25, 0.25, 0.2, 0.2, 0.2, 0.15, 0.15, 0.1, 0.1, 0.05)),
}

MORE_EXCHANGES = (0.15, 0.1)
"""With few points there are more of them: not at the least effort."""


def refine_batch(
    scene: Scene,
    terms: Terms,
    on_iteration: Callable[[Iteration], None],
    clock: StageClock,
    start: Start | None = None,
) -> Draft:
    """The file of a scene on these terms.

    `start` is there where the rounds up to the last exchange have been done.
    """
    rounding = Rounding(terms.target_mse, terms.axes)
    state = Refinement(scene, terms, rounding.aim, on_iteration, clock, start)
    target_mse, effort = terms.target_mse, EFFORTS[terms.effort]

    def settled() -> Draft:
        state.settle()
        with clock.stage("encode"):
            planned = rounding.steps(state.density)
            cost = rounding.cost(planned, state.density)
            image = image_of(state.canvas, state.points, state.colors, scene, planned)

            def mse_in(steps: Quantization) -> float:
                return state.mse_as_drawn(np.concatenate(rounded_colors(image.in_steps(steps), state.fit)))

            steps = landing_steps(mse_in, planned, state.mse, cost, target_mse + state.lack)
            found = drafted(image.in_steps(steps), scene, state.fit)
        rounding.learn(found.steps, state.density, state.mse, found.mse, state.lack)
        return found

    state.begin()
    more = True
    if start is None and state.mse <= BARE * target_mse:
        draft = settled()
        if draft.mse <= target_mse:
            return draft
    if start is None:
        state.seed(state.aim)
        more = state.grow(effort.growth, early=bool(effort.exchanges))
        if more or state.has_full_region:  # where no more points help, none can be spared
            shares, weighed = exchanges(terms.effort, len(state.points)), False
            for n, share in enumerate(shares, start=1):
                state.left = len(shares) - n
                more = state.exchange(share)
                # Where points are lacking, they are not cheap.
                if not weighed and n < len(shares) and lacks_little(state.lack, state.aim):
                    rounding.weigh(state.rise)
                    weighed = True
    else:
        rounding.weigh(start.rise)
    state.left = 0
    draft = settled()
    if effort.exchanges and state.spare > LEAST_SPARE:
        more = state.exchange(min(state.spare, LANDING))
        draft = settled()
    for _ in range(RETRIES):
        if draft.mse <= target_mse + state.lack or not more:
            break
        more = state.catch_up()
        draft = settled()
    if draft.mse > target_mse and state.fall_back():
        draft = replace(settled(), tried=draft.tried)
    return draft


def exchanges(effort: int, points: int) -> tuple[float, ...]:
    """The shares that an effort means for a picture that has grown to so many points."""
    shares = EFFORTS[effort].exchanges
    return shares + MORE_EXCHANGES if shares and points < FEW else shares
