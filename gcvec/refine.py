"""Error-driven interior control points (paper, section 4.4), in batches.

Each round fits all colours by least squares, equation (7), measures the picture, and puts new control points
where they save most. One falling threshold serves all regions, so points go where they buy most.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.canonical import Foundation, lay_unfolded_canvas
from gcvec.color_fit import ColorFit, color_fit
from gcvec.draft import Draft, by_rows, measured_mse
from gcvec.drawing import Drawing
from gcvec.least_squares import energies, solve, solve_bounded
from gcvec.raster import Coverage
from gcvec.seeding import seeds
from gcvec.selection import best_insertions, choose_points, room, usefulness
from gcvec.timing import StageClock
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POINT_WEIGHT = 0.1
"""w of equation (7): pull of a control point towards the colour of its pixel."""

BOUNDARY_WEIGHT = 0.05
"""Pull of a boundary colour towards its first estimate (section 4.3)."""

GROWTH = 0.4
FIRST_POINTS = 1 / 1500
"""A round adds this share of the points there are, and this many a pixel on top."""

CROWDED = 1 / 8
LEAST_RETURN = 0.1
IDLE_ROUNDS = 2
"""With this many points a pixel, so many rounds in a row in which the error falls by less than this power of
the number of points are the last."""

AIM = 0.9
"""Share of the target at which refinement first stops: rounding to the file's steps takes the rest."""

EXCHANGES = 2
DROPPED = 0.15
"""How often this share of the control points, the least useful, is taken out and placed anew."""

RETRIES = 4

ROUND_ITERATIONS = 8
FINAL_ITERATIONS = 16
FINAL_SWEEPS = 4
"""Conjugate gradient steps in a round, which starts from the colours of the last, and in the last fit, which
may take some sweeps to find the colours that stay at their bounds."""


@dataclass(frozen=True)
class Step:
    """What a round found and did. Errors are on the 0-255 scale; `grown` are the regions that got points."""

    iteration: int
    points: int
    worst_region: int
    worst_error: float
    mse: float
    grown: frozenset[int]


def refine_batch(
    foundation: Foundation,
    boundary_colors: Floats,
    pixels: NDArray[np.uint8],
    draft: Draft,
    target_mse: float,
    max_points: int,
    on_step: Callable[[Step], None],
    clock: StageClock,
) -> tuple[bytes, VectorImage]:
    """The file, and what it holds, whose picture has the error `target_mse` (0-255 scale) or less.

    `pixels` is the photo `(h, w, 3)`. `max_points` bounds the points of one region, 0 lifts the bound.
    """
    state = Refinement(foundation, boundary_colors, pixels / 255.0, max_points, on_step, clock)
    aim = AIM * target_mse
    state.seed(aim)
    more = state.add_until(aim)
    for _ in range(EXCHANGES):
        state.drop_least_useful(DROPPED)
        more = state.add_until(aim)
    for _ in range(RETRIES):
        state.settle()
        with clock.stage("encode"):
            data, image = draft.file(state.canvas, state.points, state.colors)
            mse = measured_mse(image, pixels)
        if mse <= target_mse or not more:
            break
        aim *= 0.98 * target_mse / mse
        more = state.add_until(aim)
    return data, image


class Refinement:
    """The refinement loop's state: control points, colours, and the canvas they are on.

    points  (n, 2) int64, pixels of the parameter domain, by rows
    colors  (b + n, 3) float64, all unknowns, boundary first
    canvas  the mesh with these points
    """

    def __init__(
        self,
        foundation: Foundation,
        boundary_colors: Floats,
        picture: Floats,
        max_points: int,
        on_step: Callable[[Step], None],
        clock: StageClock,
    ) -> None:
        """`picture` is `(h, w, 3)` in [0, 1]; `max_points` bounds the points of one region, 0 lifts the
        bound."""
        self.foundation = foundation
        self.points: Ints = np.zeros((0, 2), np.int64)
        self.colors = boundary_colors
        self._prior = boundary_colors
        self._picture = picture
        self._truth = picture.reshape(-1, 3)
        self._max_points = max_points
        self._on_step = on_step
        self._clock = clock
        self._blocked = ~room(foundation)
        self._iteration = 0
        self._update()

    def add_until(self, target_mse: float) -> bool:
        """Add control points until the picture's error is `target_mse`.

        False when no more find a place, or when they have all but stopped to help.
        """
        idle_rounds = 0
        while self.mse > target_mse:
            n, before = len(self.points), self.mse
            wanted = min(
                GROWTH * n + FIRST_POINTS * len(self._truth) + 1, (self.mse / target_mse - 1) * n + 64
            )
            with self._clock.stage("evaluation"):
                gain, where = best_insertions(self._coverage, self._residual)
                new = choose_points(
                    self.canvas,
                    self._drawing.patch,
                    gain,
                    where,
                    self._blocked,
                    int(wanted),
                    self._max_points,
                    self._finished(target_mse),
                )
            if not len(new):
                return False
            self._insert(new)
            helped = np.log(before / self.mse) >= LEAST_RETURN * np.log((n + len(new)) / max(n, 1))
            crowded = len(self.points) > CROWDED * len(self._truth)
            idle_rounds = idle_rounds + 1 if crowded and not helped else 0
            if idle_rounds == IDLE_ROUNDS:
                return False
        return True

    def _finished(self, target_mse: float) -> NDArray[np.bool_]:
        """Regions that want no more points: once some have reached their bound, those within the target.

        What the others lack cannot be made up for there, however many points are spent.
        """
        owner = self.foundation.geometry.patch_at().ravel()
        n = len(self.foundation.network.loops)
        count = np.bincount(self.canvas.patch_of_points(), minlength=n)
        if not self._max_points or count.max() < self._max_points:
            return np.zeros(n, bool)
        square = np.bincount(owner, (self._residual**2).mean(axis=1), n) * 65025
        return np.asarray(square <= target_mse * np.bincount(owner, minlength=n))

    def drop_least_useful(self, share: float) -> None:
        """Take out the given share of the control points: those whose loss costs least."""
        with self._clock.stage("evaluation"):
            values = self._fit.operator @ self.colors
            energy = energies(self._fit.to_pixels)[: len(self.points)]
            use = usefulness(
                self._drawing.image, self._drawing.triangles, values, self._fit.corner_color, energy
            )
            kept = np.ones(len(self.points), bool)
            kept[np.argsort(use)[: int(share * len(use))]] = False
            self._keep(kept)
        self._update()

    def settle(self) -> None:
        """The last fit: to convergence, and with every colour in [0, 1]."""
        with self._clock.stage("optimization"):
            equations = self._fit.equations(*self._pull())
            self.colors = solve_bounded(equations, self.colors, FINAL_ITERATIONS, 1e-5, FINAL_SWEEPS)
            self._measure()

    def seed(self, target_mse: float) -> None:
        """The first control points, for a picture that is to have the error `target_mse`."""
        with self._clock.stage("evaluation"):
            new = seeds(
                self._residual.reshape(self._picture.shape),
                target_mse,
                self._blocked,
                self.foundation.geometry.patch_at(),
                self._max_points,
            )
        if len(new):
            self._insert(new)

    def _insert(self, new: Ints) -> None:
        """Add control points `(n, 2)` with the colours of their pixels."""
        n_boundary = len(self._prior)
        points = np.concatenate([self.points, new])
        order = by_rows(points)
        colors = np.concatenate([self.colors[n_boundary:], self._picture[new[:, 1], new[:, 0]]])
        self.points = points[order]
        self.colors = np.concatenate([self.colors[:n_boundary], colors[order]])
        self._update(order >= len(points) - len(new))

    def _keep(self, kept: NDArray[np.bool_]) -> None:
        n_boundary = len(self._prior)
        self.points = self.points[kept]
        self.colors = np.concatenate([self.colors[:n_boundary], self.colors[n_boundary:][kept]])

    def _update(self, new: NDArray[np.bool_] | None = None) -> None:
        """Canvas, colours and error for the points as they are, of which some are `new` `(n,)`."""
        with self._clock.stage("mesh_harmonic"):
            self.canvas, kept = lay_unfolded_canvas(self.foundation, self.points)
            self.foundation = self.canvas.foundation
            gone = self.points[~kept]
            self._blocked[gone[:, 1], gone[:, 0]] = True
            self._keep(kept)
            fresh = slice(0) if new is None else new[kept]
            grown = frozenset(self.canvas.patch_of_points()[fresh].tolist())
        with self._clock.stage("evaluation"):
            self._drawing: Drawing = self.canvas.unit[0]
            self._coverage: Coverage = self.canvas.coverage(self._drawing)
        with self._clock.stage("optimization"):
            self._fit: ColorFit = color_fit(self.canvas, self._coverage, self._truth)
            equations = self._fit.equations(*self._pull())
            self.colors = np.clip(solve(equations, self.colors, ROUND_ITERATIONS, 1e-4), 0, 1)
            self._measure()
        self._iteration += 1
        square = (self._residual**2).sum(axis=1)
        by_region = np.bincount(self.foundation.geometry.patch_at().ravel(), square)
        worst = float(np.abs(self._residual).max() * 255)
        self._on_step(
            Step(self._iteration, len(self.points), int(by_region.argmax()), worst, self.mse, grown)
        )

    def _pull(self) -> tuple[Floats, Floats]:
        """What the unknowns are pulled towards, `(b + n, 3)`, and how much, `(b + n,)`."""
        prior = np.concatenate([self._prior, self._picture[self.points[:, 1], self.points[:, 0]]])
        pull = np.full(len(prior), POINT_WEIGHT)
        pull[: len(self._prior)] = BOUNDARY_WEIGHT
        return prior, pull

    def _measure(self) -> None:
        self._residual: Floats = self._truth - self._fit.picture(self.colors)
        self.mse = float((self._residual**2).mean() * 65025)
