"""The state of refinement (paper, section 4.4), and its rounds.

Each round fits all colours by least squares, equation (7), and measures the picture on its canonical mesh;
from there points are taken out and put in greedily (`gcvec.greedy`), on a mesh that changes with each of
them. One falling threshold serves all regions, so points go where they buy most.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcvec.colors.color_fit import ColorFit, color_fit
from gcvec.colors.least_squares import solve_bounded
from gcvec.error_scale import PEAK_SQUARE, square_of, told_mse
from gcvec.greedy import Placement, Shown, begin_placement
from gcvec.greedy.seats import Seats, find_seats
from gcvec.metrics import squared_error
from gcvec.patches.canonical import lay_unfolded_canvas
from gcvec.refinement.bargains import LEAST_RETURN, Bargains, bargains
from gcvec.refinement.clearance import find_clear_pixels
from gcvec.refinement.draft import by_rows
from gcvec.refinement.scene import Iteration, Scene, Start, Terms
from gcvec.refinement.seeding import find_seeds
from gcvec.timing import StageClock
from gcvec.vector_image import drawn_colors, to_8_bit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POINT_WEIGHT = 0.004
"""w of equation (7), for every unit of the target: pull of a control point towards the colour of its pixel.
Where nearly every pixel has one, each gives little to the picture, and a strong pull would keep it from its
target."""

BOUNDARY_WEIGHT = 0.002
"""Pull of a boundary colour towards its first estimate (section 4.3), for every unit of the target."""

PULLING_TARGETS = 1.0, 25.0
"""Pulls are those of targets between these."""

RISE = 0.75
"""Without the least useful share s of its control points a picture has about 1 + 0.75 s times the error."""

LEAST_SPARE = 0.12
"""Fewer points than this share are not worth a round that takes them out: larger steps of colours make as
good a use of what the picture has to spare."""

SETTLED = 0.995
"""Of a round's error about this share remains after the last fit."""

FIRST_POINTS = 1 / 1500
"""Points a pixel that a round may place, however few there are."""

FEW = 10_000
"""With fewer points exchanges take next to no time."""

NEAR = 1.2
EARLY, EARLY_NEAR = 1.3, 2.0
"""Growth ends within the factor `NEAR` of the aim. Where exchanges follow it works, from `FEW` points on,
towards `EARLY` times the aim, and ends within the factor `EARLY_NEAR`: they do the rest."""

LEAST_GROWTH = 0.9
"""A round of growth places points until placement foresees at most this share of the error there is: where it
has expected far too much before, as on smooth pictures, its word would say that no more points are needed."""

LEAST_CHANGE = 0.99
"""Growth ends with a round that neither adds points nor brings the error below this share of what it was."""

CROWDED = 1 / 8
IDLE_ROUNDS = 2
"""With this many points a pixel, so many rounds in a row whose points were not worth it (`LEAST_RETURN`) are
the last."""

SHIFTS = 0.35, 0.65
"""Where strips of the picture are cut, in turn: nothing changes along a cut."""

ROUND_ITERATIONS, ROUND_TOLERANCE = 4, 2e-3
FINAL_ITERATIONS, FINAL_TOLERANCE = 3, 1e-4
FINAL_SWEEPS = 2
"""Conjugate gradient steps of a fit, and the residual that is small enough to end it sooner, as a share of
the right-hand side: in a round, which starts from the colours of the last, and in each sweep of the last fit,
which find the colours that stay at their bounds."""

GROWTH = 3.0
"""A round adds this many times the points there are, at most."""

REPLACEMENT = 3.0
"""A round that takes points out puts no more than this many times as many in."""


class Refinement:
    """The refinement loop's state: control points, colours, and the canvas they are on.

    points  (n, 2) int64, pixels of the parameter domain, by rows
    colors  (b + n, 3) float64, all unknowns, boundary first
    canvas  the mesh with these points
    left    how many rounds are planned after this one, None while nobody knows
    bias    the error that greedy placement expected of the last round over what it was
    rise    by what share the error rises for each share of the points that is taken out, as the first round
            that did so has found, since later ones find fewer of little use; 0 before it
    lack    how much of the error there is because regions may have no more points: what the others cannot
            make up for, however many points are spent there
    fit     equation (7) on the canvas
    truth   (pixels, 3) float32 in [0, 1], what the picture is compared with
    residual  (pixels, 3) float32, what it lacks to that
    mse     its mean squared error (0-255 scale)

    It is made with points and canvas; colours adapt, and errors are known, once it has begun: in between it
    can be told what to `compare_with`. While points change there is neither `fit` nor `residual`: rounds let
    them go with `_let_go`, and end with `_update`, which makes them anew.
    """

    fit: ColorFit
    residual: NDArray[np.float32]
    mse: float

    def __init__(
        self,
        scene: Scene,
        terms: Terms,
        aim: Callable[[float], float],
        on_iteration: Callable[[Iteration], None],
        clock: StageClock,
        start: Start | None = None,
    ) -> None:
        """`aim` tells from the `density` the mean squared error to come to. Without a `start` there are no
        points yet."""
        self.foundation = scene.foundation
        start = start or Start(np.zeros((0, 2), np.int64), scene.boundary_colors, 0)
        self.points, self.colors = start.points, start.colors
        self._prior = scene.boundary_colors
        self._pixels = scene.pixels
        self._picture = np.divide(scene.pixels, np.float32(255))
        self.truth = self._picture.reshape(-1, 3)
        self._strength = float(np.clip(terms.target_mse, *PULLING_TARGETS))
        self._aim = aim
        self.left: int | None = None
        self.bias, self.rise, self.lack = 1.0, 0.0, start.lack
        self._max_points = terms.max_points
        self._on_iteration = on_iteration
        self._clock = clock
        self._best: Bargains | None = None
        self._areas = self._by_region()
        self._blocked = ~find_clear_pixels(scene.foundation) | (scene.foundation.geometry.triangle_at < 0)
        self._iteration = start.rounds
        self._lay()

    def begin(self) -> None:
        """Adapt the colours to what is there at first."""
        self._adapt(frozenset())

    def compare_with(self, truth: NDArray[np.float32]) -> None:
        """Compare the picture with `(pixels, 3)` from now on, in place of the photo."""
        self.truth = truth
        self.fit = self.fit.of(truth)

    @property
    def aim(self) -> float:
        """The error to aim at before colours are rounded."""
        return self._aim(self.density)

    @property
    def density(self) -> float:
        """How many colours there are for each pixel."""
        return len(self.colors) / len(self.truth)

    @property
    def spare(self) -> float:
        """Share of the control points that the picture can do without and still be as good as its aim."""
        return max(self.aim / max(self.open_mse, 1e-9) - 1, 0.0) / RISE

    def grow(self, growth: float, early: bool) -> bool:
        """Place points until the picture is nearly as good as the aim, in rounds that add `growth` times as
        many as there are at most: with many points only until it is about as good, if that is `early` enough.
        False: no more of them help."""
        idle_rounds = 0
        while True:
            n, before = len(self.points), self.mse
            goal, near = (EARLY, EARLY_NEAR) if early and n >= FEW else (1.0, NEAR)
            if self.open_mse <= near * self.aim:
                return True
            expected = min(self._foreseen(goal * self.aim, growing=True), LEAST_GROWTH * before)
            if not self._place(0.0, growth, expected):
                return False
            if len(self.points) <= n and self.mse > LEAST_CHANGE * before:
                return False
            crowded = len(self.points) > CROWDED * len(self.truth)
            helped = self.mse * max(len(self.points) / max(n, 1), 1) ** LEAST_RETURN < before
            idle_rounds = idle_rounds + 1 if crowded and not helped else 0
            if idle_rounds == IDLE_ROUNDS:
                return False

    def fall_back(self) -> bool:
        """Go back to the points that were a better bargain than those there are, in the regions where some
        were: where the aim cannot be reached, an error that has fallen by less than a small power of the
        number of points is not worth them."""
        now, best = self._bargains(self._square_errors()), self._best
        if best is None:
            return False
        back = SETTLED * best.score < now.score
        if not back.any():
            return False
        kept = now.except_in(back, best)
        order = by_rows(kept.points)
        self._have(kept.points[order], kept.colors[order])
        self.lack = 0.0
        self._update()
        return True

    def _remember(self) -> None:
        """Keep what is a better bargain than all before, before points change."""
        self._best = self._bargains(self._squares).better_of(self._best)

    def _bargains(self, squares: Floats) -> Bargains:
        """What the regions get for their points, with these squared errors `(patches,)`."""
        return bargains(squares, self._areas, self.points, self._point_colors, self.canvas.patch_of_points())

    def _square_errors(self) -> Floats:
        """`(patches,)` squared errors of the regions, in [0, 1] colours."""
        return self._by_region((self.residual**2).sum(axis=1)).astype(np.float64)

    def _by_region(self, values: NDArray[np.float32] | None = None) -> NDArray[Any]:
        """`(patches,)` sums over each region of `values` `(pixels,)`; without them, its number of pixels."""
        n_patches = len(self.foundation.network.loops)
        return np.bincount(self.foundation.geometry.patch_at().ravel(), values, n_patches)[:n_patches]

    def catch_up(self) -> bool:
        """Place the points that are missing. False when no more points help."""
        return self._place(0.0, GROWTH, self._foreseen(SETTLED * self.aim, growing=False))

    def exchange(self, share: float) -> bool:
        """Take out the least useful `share` of the control points, and place as many new ones as the aim asks
        for. False when no more points help."""
        return self._place(share, REPLACEMENT * share or GROWTH, self._foreseen(self.aim, growing=not share))

    def _place(self, share: float, growth: float, expected: float) -> bool:
        """One round: take out the least useful `share` of the control points, and place new ones, `growth`
        times as many as there are at most, until the error is expected to be so much. False when no more
        points help."""
        self._remember()
        with self._clock.stage("evaluation"):
            new, foreseen, more = self._change_points(share, growth, self._to_square(expected))
        self._update(new)
        self.bias = foreseen / max(self._to_square(self.mse), 1e-12)
        return more

    def _change_points(
        self, share: float, growth: float, goal: float
    ) -> tuple[NDArray[np.bool_], float, bool]:
        """Points and their colours after a round whose squared error shall come to `goal`: which of them are
        new `(n,)`, the squared error expected of them, and whether more would help."""
        most = int(growth * len(self.points) + FIRST_POINTS * len(self.truth)) + 4
        placement = self._begun_placement()
        before = placement.error
        placement.thin_out(share)
        if share and not self.rise:
            self.rise = (placement.error / max(before, 1e-12) - 1) / share
        more = placement.grow(goal, most)
        points, colors, new = placement.result()
        self._have(points, colors)
        self.lack = told_mse(placement.lack, self.truth.size)
        return new, placement.error, more

    def _begun_placement(self) -> Placement:
        """Placement that starts from the picture as it is, which is let go."""
        on_canvas = self.fit.operator @ self.colors
        shown = Shown(self.canvas, self.points, on_canvas, self.residual, self._picture.reshape(-1, 3))
        self._let_go()
        pull, shift = POINT_WEIGHT * self._strength, SHIFTS[self._iteration % 2]
        return begin_placement(shown, self._seats(), self._room(), pull, shift)

    def _let_go(self) -> None:
        """Fit and residual, which are large, and of no use once points change."""
        del self.fit, self.residual

    def _foreseen(self, mse: float, growing: bool) -> float:
        """The error that greedy placement expects of a picture that comes to `mse` after the last fit.

        After a round of growth the error is often a little lower than its placement foresaw; after one that
        places few points it is not.
        """
        return (self.bias if growing else min(self.bias, 1.0)) * mse / SETTLED

    def _seats(self) -> Seats:
        taken = self._blocked.copy()
        taken[self.points[:, 1], self.points[:, 0]] = True
        return find_seats(self.foundation, taken)

    def _room(self) -> Ints | None:
        """How many more points each patch may have; None: any number."""
        if not self._max_points:
            return None
        return np.maximum(self._max_points - self._points_by_region(), 0)

    def _points_by_region(self) -> Ints:
        return np.bincount(self.canvas.patch_of_points(), minlength=len(self.foundation.network.loops))

    def _to_square(self, mse: float) -> float:
        """Squared error, summed over pixels and channels, of a mean squared error on the 0-255 scale."""
        return square_of(mse, self.truth.size)

    @property
    def has_full_region(self) -> bool:
        """Whether a region has as many points as it may have."""
        return bool(self._max_points) and int(self._points_by_region().max()) >= self._max_points

    @property
    def open_mse(self) -> float:
        """The error that is compared with the aim: the picture's without what regions lack that are full."""
        return self.mse - self.lack

    def converge(self) -> None:
        """Bring the colours closer to the best ones for these control points."""
        self._fit(ROUND_ITERATIONS, ROUND_TOLERANCE, sweeps=1)

    def settle(self) -> None:
        """The last fit: to convergence."""
        self._fit(FINAL_ITERATIONS, FINAL_TOLERANCE, FINAL_SWEEPS)

    def _fit(self, iterations: int, tolerance: float, sweeps: int) -> None:
        """Colours in [0, 1] by equation (7), from those there are."""
        with self._clock.stage("optimization"):
            equations = self.fit.equations(*self._pull())
            self.colors = solve_bounded(equations, self.colors, iterations, tolerance, sweeps)
            self._measure()

    def seed(self, fair_aim: float) -> None:
        """Place the first control points of a picture whose mean squared error, over all of it, shall come to
        `fair_aim`."""
        self._remember()
        with self._clock.stage("evaluation"):
            new = find_seeds(
                self.residual.reshape(self._picture.shape),
                fair_aim,
                self._blocked,
                self.foundation.geometry.patch_at(),
                self._max_points,
            )
        if len(new):
            self._let_go()
            self._insert(new)

    def _insert(self, new: Ints) -> None:
        """Add control points `(n, 2)` with the colours of their pixels."""
        points = np.concatenate([self.points, new])
        colors = np.concatenate([self._point_colors, self._picture[new[:, 1], new[:, 0]]])
        order = by_rows(points)
        self._have(points[order], colors[order])
        self._update(order >= len(points) - len(new))

    def _have(self, points: Ints, colors: Floats) -> None:
        """Have these control points `(n, 2)`, by rows, and their colours `(n, 3)`, in place of all others."""
        self.points = points
        self.colors = np.concatenate([self.colors[: len(self._prior)], colors])

    @property
    def _point_colors(self) -> Floats:
        """`(n, 3)` colours of the control points."""
        return self.colors[len(self._prior) :]

    def _update(self, new: NDArray[np.bool_] | None = None) -> None:
        """Canvas, colours and error for the points as they are, of which some are `new` `(n,)`."""
        kept = self._lay()
        fresh = slice(0) if new is None else new[kept]
        self._adapt(frozenset(self.canvas.patch_of_points()[fresh].tolist()))

    def _lay(self) -> NDArray[np.bool_]:
        """Canvas and fit for the points as they are; which of them `(n,)` it has kept."""
        with self._clock.stage("mesh_harmonic"):
            self.canvas, kept = lay_unfolded_canvas(self.foundation, self.points)
            self.foundation = self.canvas.foundation
            gone = self.points[~kept]
            self._blocked[gone[:, 1], gone[:, 0]] = True
            self._have(self.points[kept], self._point_colors[kept])
        with self._clock.stage("evaluation"):
            coverage = self.canvas.coverage(self.canvas.unit[0], np.float32)
        with self._clock.stage("optimization"):
            self.fit = color_fit(self.canvas, coverage, self.truth)
        return kept

    def _adapt(self, grown: frozenset[int]) -> None:
        """Colours and error on a new canvas, whose regions `grown` have got points."""
        self.converge()
        self._iteration += 1
        self._squares = self._square_errors()
        worst = float(np.abs(self.residual).max() * 255)
        self._on_iteration(
            Iteration(
                self._iteration,
                len(self.points),
                int(self._squares.argmax()),
                worst,
                self.mse,
                grown,
                self.left,
            )
        )

    def _pull(self) -> tuple[Floats, Floats]:
        """What the unknowns are pulled towards, `(b + n, 3)`, and how much, `(b + n,)`."""
        prior = np.concatenate([self._prior, self._picture[self.points[:, 1], self.points[:, 0]]])
        pull = np.full(len(prior), POINT_WEIGHT * self._strength)
        pull[: len(self._prior)] = BOUNDARY_WEIGHT * self._strength
        return prior, pull

    def mse_as_drawn(self, colors: Floats) -> float:
        """The mean squared error of the picture with these colours `(b + n, 3)`, in 8 bits."""
        picture = to_8_bit(self.truth - self.fit.residual(drawn_colors(colors), self.truth))
        return float(squared_error(picture, self._pixels.reshape(-1, 3)).mean())

    def _measure(self) -> None:
        self.residual = self.fit.residual(self.colors, self.truth)
        self.mse = float(np.mean(self.residual**2, dtype=np.float64) * PEAK_SQUARE)
