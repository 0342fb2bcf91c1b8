"""The rounds of one part."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gcvec.colors.color_fit import ColorFit
from gcvec.error_scale import PEAK_SQUARE, told_mse
from gcvec.parts.messages import PartRequest, PartResult
from gcvec.patches.canonical import lay_foundation
from gcvec.refinement.rounding import Rounding, lacks_little
from gcvec.refinement.scene import Iteration, Scene, Start, Terms
from gcvec.refinement.state import LEAST_SPARE, Refinement
from gcvec.timing import StageClock

SLIVER = 1e-3
"""A pixel belongs to one part alone where others cover no more than this share of it."""

MOST_SPARE = 0.5
"""No turn takes out more than this share of the points, beyond those it is asked to exchange."""


def refine_part(
    request: PartRequest, pixels: NDArray[np.uint8], on_iteration: Callable[[Iteration], None]
) -> PartResult:
    """Do what is asked of a part of the photo `(h, w, 3)`, all of it, as if the rest of it stood still.

    In pixels that it shares with others it is compared with what it is wanted to give to them: where nobody
    has said what that is, with what it gives at the beginning of the round.

    The same request has the same result wherever it is done. `on_iteration` hears of every turn; an
    exception it raises ends the work.
    """
    network = request.network
    column, row = network.origin or (0, 0)
    frame = pixels[row : row + network.height, column : column + network.width]
    as_planned, rounding = (Rounding(request.target_mse, request.axes) for _ in range(2))
    goal = told_mse(request.goal, frame.size)
    iterations: list[Iteration] = []

    def note(made: Iteration) -> None:
        iterations.append(made)
        on_iteration(made)

    state = Refinement(
        Scene(frame, lay_foundation(network, request.hard), request.prior),
        Terms(request.target_mse, request.max_points),
        lambda density: goal * rounding.aim(density) / as_planned.aim(density),
        note,
        StageClock(),
        Start(request.points, request.colors, request.rounds),
    )
    state.bias = request.bias
    state.compare_with(_wanted(state, request))
    state.begin()
    if not request.rounds:
        state.seed(as_planned.aim(state.density))
    more = True
    for n, share in enumerate(request.shares, start=1):
        spare = min(state.spare, MOST_SPARE) if request.rounds else 0.0
        more = state.exchange(max(share, spare if spare > LEAST_SPARE else 0.0))
        if n == 1 < len(request.shares) and lacks_little(state.lack, state.aim):
            rounding.weigh(state.rise)
    return _result(request.number, state, iterations, more)


def _wanted(state: Refinement, request: PartRequest) -> NDArray[np.float32]:
    """`(pixels, 3)` what a part is compared with."""
    shared = _covered(state.fit) < 1 - SLIVER
    truth = state.truth.copy()
    truth[shared] -= state.fit.residual(state.colors, truth)[shared]
    truth[request.shared] = request.wanted
    return truth


def _result(number: int, state: Refinement, iterations: list[Iteration], more: bool) -> PartResult:
    """A part as it is after these iterations; `more`: whether more points would help."""
    cover = _covered(state.fit)
    shared = np.flatnonzero((cover > SLIVER) & (cover < 1 - SLIVER))
    beside = state.residual[shared]
    square = state.truth.size / PEAK_SQUARE
    grown = frozenset[int]().union(*(made.grown for made in iterations))
    course = [(made.points, made.mse * square) for made in iterations if made.points]
    return PartResult(
        number=number,
        points=state.points,
        colors=state.colors,
        square=state.mse * square,
        lack=state.lack * square,
        square_shared=float(np.sum(beside**2, dtype=np.float64)),
        course=np.array(course, np.float64).reshape(-1, 2),
        bias=state.bias,
        rise=state.rise,
        worst=float(np.abs(state.residual).max() * 255),
        grown=np.array(sorted(grown), np.int64),
        more=more,
        shared=shared,
        cover=cover[shared],
        given=state.truth[shared] - beside,
    )


def _covered(fit: ColorFit) -> NDArray[np.float32]:
    """`(pixels,)` the share of each pixel that the patches of a fit cover."""
    return np.asarray(fit.design @ np.ones(fit.design.shape[1], np.float32))
