"""Where control points go: into the triangles where one saves most, one after another, all over the picture.

All strips of the picture work with the same falling threshold on what a point must save, so points go where
they buy most; between two thresholds colours adapt and every triangle is looked at again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.greedy.colors import adapt, usefulness
from gcvec.greedy.delaunay import insert, remove
from gcvec.greedy.plot import (
    CANDIDATES,
    NOBODY,
    TRIANGLES,
    VERTICES,
    Plot,
    barycentric,
)
from gcvec.greedy.seats import Seats, image_of
from gcvec.kernels import bare_kernel
from gcvec.mesh import jittered
from gcvec.parallel import in_turn

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_COVER = 0.3
"""A pixel can become a control point of a triangle that covers at least this share of it."""

LEAST_MARGIN = 0.02
"""Least weight of a triangle's corner at a new control point."""

FALL = 1.2
"""New points take this much more from the error than each would alone: the others' colours adapt."""

EAGER = 0.3
"""With each threshold this share of the points is placed that the error seems to ask for: the best ones."""

NEAR_ENOUGH = 0.003
NEARLY = 0.85
MOST_LEVELS = 30
"""Enough is an error within this share of the goal, or so many of the points allowed, or thresholds."""


@bare_kernel
def _look(first, last, pixels, weights, residual, under, taken, patch_at, patch, offset, worst, candidate):
    """Where in a triangle a point would save most, and how much.

    A new point at barycentric coordinates q reaches out like the hat function φ = min_k(b_k / q_k). The best
    colour for it removes (Σ a r φ)² / Σ a φ² from the error, summed over the triangle's share a of each
    pixel; a is in the weights.
    """
    most, best = 0.0, NOBODY
    n = 0
    for e in range(first, last):
        if weights[e, 0] + weights[e, 1] + weights[e, 2] < LEAST_COVER:
            continue
        pixel = pixels[e]
        square = residual[pixel, 0] ** 2 + residual[pixel, 1] ** 2 + residual[pixel, 2] ** 2
        if n == CANDIDATES and square <= worst[n - 1]:
            continue
        at = under[pixel + offset]
        if taken[at] or patch_at[at] != patch:
            continue
        n = min(n + 1, CANDIDATES)
        k = n - 1
        while k > 0 and worst[k - 1] < square:
            worst[k], candidate[k] = worst[k - 1], candidate[k - 1]
            k -= 1
        worst[k], candidate[k] = square, e
    for i in range(n):
        e = candidate[i]
        area = weights[e, 0] + weights[e, 1] + weights[e, 2]
        if min(weights[e, 0], weights[e, 1], weights[e, 2]) < LEAST_MARGIN * area:
            continue
        q0, q1, q2 = area / weights[e, 0], area / weights[e, 1], area / weights[e, 2]
        r0, r1, r2, energy = 0.0, 0.0, 0.0, 1e-12
        for f in range(first, last):
            share = min(weights[f, 0] * q0, weights[f, 1] * q1, weights[f, 2] * q2)
            if share <= 0.0:
                continue
            p = pixels[f]
            r0 += share * residual[p, 0]
            r1 += share * residual[p, 1]
            r2 += share * residual[p, 2]
            energy += share * share / (weights[f, 0] + weights[f, 1] + weights[f, 2])
        gain = (r0 * r0 + r1 * r1 + r2 * r2) / energy
        if gain > most:
            most, best = gain, pixels[e]
    return most, best


@bare_kernel
def _look_everywhere(plot, seats):
    offset = plot.first_row * plot.width
    for t in range(plot.counts[TRIANGLES]):
        if not plot.stale[t] or plot.triangles[t, 0] == NOBODY:
            continue
        plot.stale[t] = False
        plot.gain[t], plot.best[t] = _look(
            plot.first[t], plot.last[t], plot.pixel, plot.weights, plot.residual,
            seats.under, seats.taken, seats.patch, plot.patch[t], offset, plot.worst, plot.candidate,
        )  # fmt: skip


@bare_kernel
def _settle(plot, seats, pull, sweeps):
    for _ in range(sweeps):
        for v in range(plot.counts[VERTICES]):
            if plot.whole[v] and plot.restless[v]:
                adapt(plot, v, pull)
    _look_everywhere(plot, seats)
    return _square(plot.residual)


@bare_kernel
def _square(residual):
    total = 0.0
    for pixel in range(len(residual)):
        for k in range(3):
            total += residual[pixel, k] ** 2
    return total


@bare_kernel
def _grow(plot, seats, queue, threshold, room, pull):
    """Place points in the triangles of a queue, where one saves more than the threshold and at most
    `room[p]` in patch p; what is new has to wait until colours have adapted."""
    placed = 0
    for t in queue:
        patch = plot.patch[t]
        if plot.gain[t] <= threshold or room[patch] == 0 or plot.counts[VERTICES] + 1 >= len(plot.domain):
            continue
        n_new = _place(plot, seats, t, plot.holes, pull)
        plot.gain[t] = 0.0
        for i in range(n_new):
            plot.gain[plot.holes[i]] = 0.0
        if n_new > 0:
            placed += 1
            room[patch] -= 1
    return placed


@bare_kernel
def _place(plot, seats, t, holes, pull):
    """Put a control point where it saves most in a triangle; its new triangles are `holes[:n]`, n is
    returned."""
    pixel = plot.best[t]
    at = seats.under[pixel + plot.first_row * plot.width]
    if seats.taken[at]:
        return 0
    v = plot.counts[VERTICES]
    x, y = jittered(at % seats.width + seats.column, at // seats.width + seats.row)
    x, y = x - seats.column, y - seats.row
    plot.domain[v, 0], plot.domain[v, 1] = x, y
    plot.image[v, 0], plot.image[v, 1] = image_of(seats, x, y, at)
    a, b, c = plot.triangles[t, 0], plot.triangles[t, 1], plot.triangles[t, 2]
    w0, w1, w2 = barycentric(plot.image, a, b, c, plot.image[v, 0], plot.image[v, 1])
    for k in range(3):
        color = w0 * plot.color[a, k] + w1 * plot.color[b, k] + w2 * plot.color[c, k]
        plot.color[v, k] = min(max(color, 0.0), 1.0)
    n_new = insert(plot, v, t, holes)
    if n_new > 0:
        plot.counts[VERTICES] += 1
        plot.seat[v] = at
        plot.whole[v] = True
        seats.taken[at] = True
        adapt(plot, v, pull)
    return n_new


@bare_kernel
def _rate(plot, use):
    """Usefulness of every vertex, infinite for those that cannot be taken out."""
    for v in range(len(use)):
        use[v] = usefulness(plot, v) if plot.whole[v] else np.inf


@bare_kernel
def _thin(plot, use, limit):
    """Take out the vertices whose usefulness is `limit` or less."""
    for v in range(len(use)):
        if plot.whole[v] and use[v] <= limit and remove(plot, v, plot.holes) > 0:
            plot.whole[v] = False
            plot.seat[v] = NOBODY


class Placement:
    """Placing control points on one mesh, until the next one is made.

    plots   strips of the picture
    error   squared error of the picture as it is, in [0, 1] colours, summed over pixels and channels
    """

    def __init__(self, plots: list[Plot], seats: Seats, error: float, room: Ints | None, pull: float) -> None:
        """`room` `(patches,)` is how many more points each patch may have, None: any number. `pull` is w of
        equation (7)."""
        self.plots = plots
        self._seats = seats
        self._elsewhere = 0.0
        self._room = room
        self._none_full = room is not None and bool(room.all())
        self._pull = pull
        self._first_new = [int(plot.counts[VERTICES]) for plot in plots]
        # Where strips overlap each sees its own changes only.
        self.error = 0.0
        self.settle(0)
        self._elsewhere = error - self.error
        self.error = error

    def thin_out(self, fewer: int, finished: NDArray[np.bool_]) -> None:
        """Take out the `fewer` least useful points, but none of patches that are `finished`; their seats
        stay taken."""
        if not fewer:
            return
        rated = [np.empty(plot.counts[VERTICES]) for plot in self.plots]
        pairs = list(zip(self.plots, rated, strict=True))
        in_turn(lambda pair: _rate(*pair), pairs)
        patches = [plot.patch[plot.at_vertex[: len(use)]] for plot, use in pairs]
        for use, patch in zip(rated, patches, strict=True):
            use[finished[patch]] = np.inf
        every = np.concatenate(rated)
        every = every[np.isfinite(every)]
        fewer = min(fewer, len(every))
        if not fewer:
            return
        limit = np.partition(every, fewer - 1)[fewer - 1]
        in_turn(lambda pair: _thin(*pair, limit), pairs)
        if self._room is not None:
            for (plot, use), patch in zip(pairs, patches, strict=True):
                gone = np.isfinite(use) & (plot.seat[: len(use)] == NOBODY)
                self._room += np.bincount(patch[gone], minlength=len(self._room))
        self.settle()

    def settle(self, sweeps: int = 1) -> None:
        """Let colours adapt, and look at every triangle again."""
        squares = in_turn(lambda plot: _settle(plot, self._seats, self._pull, sweeps), self.plots)
        self.error = self._elsewhere + sum(squares)

    def grow(self, goal: float, most: int) -> bool:
        """Place points until the error is `goal` or less, about `most` are placed, a first patch has all that
        it may have, or plots have no room for more. False: no more points help."""
        placed = 0
        for _ in range(MOST_LEVELS):
            missing = self.error - goal
            if missing <= NEAR_ENOUGH * goal or placed >= NEARLY * most:
                return True
            gain = np.sort(np.concatenate([self._gains(plot) for plot in self.plots]))[::-1]
            if not len(gain):
                return False
            wanted = int(EAGER * np.searchsorted(FALL * np.cumsum(gain), missing))
            wanted = max(min(wanted, int(EAGER * (most - placed))), 1)
            new = self._place_above(float(gain[wanted]) if wanted < len(gain) else 0.0)
            if not new:
                return any(plot.counts[VERTICES] + 1 >= len(plot.domain) for plot in self.plots)
            placed += new
            self.settle()
            if self._none_full and self._room is not None and not self._room.all():
                self._none_full = False
                return True  # whether others should go on is not for this to say
        return True

    def result(self) -> tuple[Ints, Floats, NDArray[np.bool_]]:
        """Control points `(n, 2)` as pixels of the domain, their colours, and which ones are new; by rows."""
        held = [np.flatnonzero(plot.seat[: plot.counts[VERTICES]] >= 0) for plot in self.plots]
        seat = np.concatenate([plot.seat[own] for plot, own in zip(self.plots, held, strict=True)])
        color = np.concatenate([plot.color[own] for plot, own in zip(self.plots, held, strict=True)])
        new = np.concatenate([own >= first for own, first in zip(held, self._first_new, strict=True)])
        # Those along the cuts are in several plots.
        seat, one = np.unique(seat, return_index=True)
        return np.stack([seat % self._seats.width, seat // self._seats.width], axis=1), color[one], new[one]

    def _gains(self, plot: Plot) -> Floats:
        """What points would save in the triangles where they do and can be."""
        gain = plot.gain[: plot.counts[TRIANGLES]]
        useful = gain > 0
        if self._room is not None:
            useful &= self._room[plot.patch[: len(gain)]] > 0
        return gain[useful]

    def _place_above(self, threshold: float) -> int:
        def grow(plot: Plot, room: Ints) -> int:
            gain = plot.gain[: plot.counts[TRIANGLES]]
            queue = np.flatnonzero(gain > threshold)
            return int(_grow(plot, self._seats, queue[np.argsort(-gain[queue])], threshold, room, self._pull))

        if self._room is not None:
            return sum(grow(plot, self._room) for plot in self.plots)
        free = np.full(int(self._seats.patch.max()) + 1, len(self._seats.patch))
        return sum(in_turn(lambda plot: grow(plot, free.copy()), self.plots))
