"""The rounds of one part."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.colors.color_fit import ColorFit
from gcvec.colors.least_squares import from_pixels
from gcvec.parts.messages import PartRequest, PartResult
from gcvec.patches.canonical import lay_foundation
from gcvec.quantization import Quantization
from gcvec.raster.coverage import Coverage
from gcvec.refinement.scene import Scene, Start, Step, Terms
from gcvec.refinement.state import LEAST_SPARE, Refinement
from gcvec.timing import StageClock

SLIVER = 1e-3
"""A pixel belongs to one part alone where others cover no more than this share of it."""

MOST_SPARE = 0.5
"""No turn takes out more than this share of the points, beyond those it is asked to exchange."""


def refine_part(
    request: PartRequest, pixels: NDArray[np.uint8], on_step: Callable[[Step], None]
) -> PartResult:
    """Do what is asked of a part of the photo `(h, w, 3)`, all of it.

    The same request has the same result wherever it is done. `on_step` hears of every turn; an exception it
    raises ends the work.
    """
    state = PartRefinement(request, pixels, on_step)
    if not request.rounds:
        state.seed()
    more = True
    for share in request.shares:
        spare = min(state.spare, MOST_SPARE) if request.rounds else 0.0
        more = state.turn_over(max(share, spare if spare > LEAST_SPARE else 0.0))
    return state.result(more)


class PartRefinement(Refinement):
    """Refinement of a part, as if the rest of the picture stood still.

    In pixels that it shares with others it is compared with what it is wanted to give to them: where nobody
    has said what that is, with what it gives at the beginning of the round.
    """

    def __init__(
        self, request: PartRequest, pixels: NDArray[np.uint8], on_step: Callable[[Step], None]
    ) -> None:
        self._request = request
        self._compared = False
        self._course: list[tuple[float, float]] = []
        self._grown: set[int] = set()
        self._hear = on_step
        network = request.network
        column, row = network.origin or (0, 0)
        frame = pixels[row : row + network.height, column : column + network.width]
        super().__init__(
            Scene(frame, lay_foundation(network, request.hard), request.prior),
            Terms(request.fair_aim, Quantization(), request.max_points),
            self._note,
            StageClock(),
            Start(request.points, request.colors, request.rounds),
        )
        self.bias = request.bias

    @property
    def aim(self) -> float:
        """The error to aim at, over all pixels of the frame."""
        return self._request.goal * 65025 / self._truth.size

    @property
    def fair_aim(self) -> float:
        """The mean error of a whole picture that is as good as the aim."""
        return self._request.fair_aim

    def result(self, more: bool) -> PartResult:
        """The part as it is; `more`: whether more points would help."""
        cover = self._covered()
        shared = np.flatnonzero((cover > SLIVER) & (cover < 1 - SLIVER))
        beside = self._residual[shared]
        return PartResult(
            number=self._request.number,
            points=self.points,
            colors=self.colors,
            square=self._to_square(self.mse),
            lack=self._to_square(self.lack),
            square_shared=float(np.sum(beside**2, dtype=np.float64)),
            course=np.array(self._course, np.float64).reshape(-1, 2),
            energy=float(self._fit.energy.sum()),
            bias=self.bias,
            worst=float(np.abs(self._residual).max() * 255),
            grown=np.array(sorted(self._grown), np.int64),
            more=more,
            shared=shared,
            cover=cover[shared],
            given=self._truth[shared] - beside,
        )

    def _covered(self) -> NDArray[np.float32]:
        """`(pixels,)` the share of each pixel that the part covers."""
        return np.asarray(self._fit.design @ np.ones(self._fit.design.shape[1], np.float32))

    def _note(self, step: Step) -> None:
        self._grown |= step.grown
        if step.points:
            self._course.append((step.points, self._to_square(step.mse)))
        self._hear(step)

    def _fitted(self, coverage: Coverage) -> ColorFit:
        fit = super()._fitted(coverage)
        if self._compared:
            return fit
        self._compared = True
        request, self._fit = self._request, fit
        shared = self._covered() < 1 - SLIVER
        truth = self._truth.copy()
        truth[shared] -= fit.residual(self.colors, truth)[shared]
        truth[request.shared] = request.wanted
        self._truth = truth
        return replace(fit, target=fit.operator.T @ from_pixels(fit.design, truth))
