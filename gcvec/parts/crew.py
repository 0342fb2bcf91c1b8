"""The rounds of a picture whose parts are refined by a crew."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gcvec.error_scale import PEAK_SQUARE, square_of, told_mse
from gcvec.parts.division import divided, part_of
from gcvec.parts.goals import common_goals
from gcvec.parts.messages import PartRequest, PartResult
from gcvec.parts.shared import shared_pixels
from gcvec.refinement.batch import exchanges
from gcvec.refinement.draft import by_rows
from gcvec.refinement.rounding import Rounding, lacks_little
from gcvec.refinement.scene import Iteration, Scene, Start, Terms
from gcvec.refinement.state import LEAST_CHANGE

Floats = NDArray[np.float64]

FIRST_GOAL = 1.5
"""The first round ends, in parts that come so far, with this many times the error that the picture aims at:
no part has then more points than it will need."""

SHARED_ERROR = 3.0
"""In pixels that parts share the mean error comes to about this many times that of the picture: it is larger
at first, until each part has seen what the others give."""

CLOSE = 1.2
MOST_GROWTH_ROUNDS = 6
"""Growth ends within this factor of the aim, or after so many rounds more: exchanges do the rest."""


class Crew(Protocol):
    """Whoever refines parts.

    parts  into how many a picture is divided
    """

    @property
    def parts(self) -> int: ...

    def __call__(self, requests: Sequence[PartRequest], pixels: NDArray[np.uint8]) -> Iterable[PartResult]:
        """The results of `gcvec.parts.part.refine_part` for all requests, in any order."""
        ...


def refine_by(crew: Crew, scene: Scene, terms: Terms, on_iteration: Callable[[Iteration], None]) -> Start:
    """All rounds of a picture but the last, in parts."""
    rounds = _Rounds(crew, scene, terms, on_iteration)
    rounds.run((0.0,), FIRST_GOAL * rounds.own_aims())
    for _ in range(MOST_GROWTH_ROUNDS):
        points, before = rounds.n_points, rounds.square
        rounds.run((0.0,), rounds.goals())
        if rounds.open_square <= CLOSE * rounds.aim or not rounds.more:
            break
        if rounds.n_points <= points and rounds.square > LEAST_CHANGE * before:
            break
    shares = exchanges(terms.effort, rounds.n_points)
    if shares:
        rounds.run(shares, rounds.goals(), left=0)
    return rounds.merged()


class _Rounds:
    """The parts of a picture between rounds."""

    def __init__(
        self, crew: Crew, scene: Scene, terms: Terms, on_iteration: Callable[[Iteration], None]
    ) -> None:
        self._crew = crew
        self._pixels = scene.pixels
        self._prior = scene.boundary_colors
        self._terms = terms
        self._on_iteration = on_iteration
        self._done = 0
        foundation = scene.foundation
        self._parts = [part_of(foundation, patches) for patches in divided(foundation, crew.parts)]
        self._areas = np.bincount(foundation.geometry.patch_at().ravel())
        self._states = [_unborn(k, self._prior[part.colors]) for k, part in enumerate(self._parts)]
        self._shared = shared_pixels(self._pixels, self._parts, self._states)

    @property
    def n_points(self) -> int:
        return sum(len(state.points) for state in self._states)

    @property
    def square(self) -> float:
        """Squared error of the picture."""
        return sum(state.square for state in self._states) + self._shared.excess

    @property
    def open_square(self) -> float:
        """What more points could still lower of it: without what regions lack that are full."""
        return self.square - self._lack

    @property
    def _lack(self) -> float:
        return sum(state.lack for state in self._states)

    @property
    def more(self) -> bool:
        """Whether more points would help in some part."""
        return any(state.more for state in self._states)

    @property
    def fair_aim(self) -> float:
        """The mean squared error to aim at (0-255 scale)."""
        density = (len(self._prior) + self.n_points) / (self._pixels.size / 3)
        return Rounding(self._terms.target_mse, self._terms.axes).aim(density)

    @property
    def aim(self) -> float:
        """The squared error to aim at."""
        return square_of(self.fair_aim, self._pixels.size)

    def own_aims(self) -> Floats:
        """`(parts,)` squared errors of parts that are all as good as the picture has to be."""
        areas = np.array([self._areas[part.patches].sum() for part in self._parts])
        return np.asarray(self.aim * areas / areas.sum())

    def goals(self) -> Floats:
        """`(parts,)` the squared errors that the parts have at one price, and that add up to the aim."""
        usual = SHARED_ERROR * self.fair_aim * self._shared.n * 3 / PEAK_SQUARE
        return common_goals(self._states, self.aim - min(self._shared.excess, usual))

    @property
    def rise(self) -> float:
        """See `Refinement`: of all parts together, 0 where points are lacking, which are not cheap then."""
        if not lacks_little(self._lack, self.aim):
            return 0.0
        squares = np.array([state.square for state in self._states])
        rises = np.array([state.rise for state in self._states])
        return float((squares * rises).sum() / max(squares.sum(), 1e-12))

    def run(self, shares: tuple[float, ...], goals: Floats, left: int | None = None) -> None:
        """Have all parts refined once more; after that so many rounds are `left`, None while nobody knows."""
        requests = [
            PartRequest(
                number=state.number,
                rounds=self._done,
                network=part.network,
                hard=part.hard,
                prior=self._prior[part.colors],
                points=state.points,
                colors=state.colors,
                target_mse=self._terms.target_mse,
                axes=self._terms.axes,
                goal=float(goal),
                shares=shares,
                max_points=self._terms.max_points,
                bias=state.bias,
                shared=state.shared,
                wanted=wanted,
            )
            for part, state, goal, wanted in zip(
                self._parts, self._states, goals, self._shared.wanted, strict=True
            )
        ]
        for result in self._crew(requests, self._pixels):
            before = self._states[result.number]
            course = np.concatenate([before.course, result.course])
            self._states[result.number] = replace(result, course=course)
        self._done += 1
        self._shared = shared_pixels(self._pixels, self._parts, self._states)
        self._on_iteration(self._iteration(left))

    def _iteration(self, left: int | None) -> Iteration:
        worst = max(self._states, key=lambda state: state.square)
        grown = [self._parts[state.number].patches[state.grown] for state in self._states]
        return Iteration(
            self._done,
            self.n_points,
            int(self._parts[worst.number].patches[0]),
            max(state.worst for state in self._states),
            told_mse(self.square, self._pixels.size),
            frozenset(np.concatenate(grown).tolist()),
            left,
        )

    def merged(self) -> Start:
        """The picture with the points of all parts; boundary colours that several have are averaged."""
        total, count = np.zeros_like(self._prior), np.zeros(len(self._prior))
        for part, state in zip(self._parts, self._states, strict=True):
            np.add.at(total, part.colors, state.colors[: len(part.colors)])
            np.add.at(count, part.colors, 1)
        points = np.concatenate([s.points + p.origin for p, s in zip(self._parts, self._states, strict=True)])
        inner = [s.colors[len(p.colors) :] for p, s in zip(self._parts, self._states, strict=True)]
        order = by_rows(points)
        boundary = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], self._prior)
        colors = np.concatenate([boundary, np.concatenate(inner)[order]])
        lack = told_mse(self._lack, self._pixels.size)
        return Start(points[order], colors, self._done, lack, self.rise)


def _unborn(number: int, colors: Floats) -> PartResult:
    """A part before the first round."""
    return PartResult(
        number=number,
        points=np.zeros((0, 2), np.int64),
        colors=colors,
        square=0.0,
        lack=0.0,
        square_shared=0.0,
        course=np.zeros((0, 2)),
        bias=1.0,
        rise=0.0,
        worst=0.0,
        grown=np.zeros(0, np.int64),
        more=True,
        shared=np.zeros(0, np.int64),
        cover=np.zeros(0, np.float32),
        given=np.zeros((0, 3), np.float32),
    )
