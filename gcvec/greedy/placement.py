"""Where control points go: into the triangles where one saves most, one after another, all over the picture.

All strips of the picture work with the same falling threshold on what a point must save, so points go where
they buy most; between two thresholds colours adapt and every triangle is looked at again.
"""

from __future__ import annotations

from functools import partial

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
from gcvec.greedy.queues import NONE_FULL, Full, Queue, how_many, useful
from gcvec.greedy.seats import Seats, image_of
from gcvec.kernels import bare_kernel
from gcvec.parallel import in_turn
from gcvec.patches.mesh import jittered
from gcvec.refinement.seeding import rank_in_group

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_COVER = 0.3
"""A pixel can become a control point of a triangle that covers at least this share of it."""

LEAST_MARGIN = 0.02
"""Least weight of a triangle's corner at a new control point."""

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
def look_everywhere(plot, seats):
    """Look at every triangle in which something has changed."""
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
def _settle(plot, pull):
    for v in range(plot.counts[VERTICES]):
        if plot.whole[v] and plot.restless[v]:
            adapt(plot, v, pull)
    return _square(plot.residual)


@bare_kernel
def _square(residual):
    total = 0.0
    for pixel in range(len(residual)):
        for k in range(3):
            total += residual[pixel, k] ** 2
    return total


@bare_kernel
def _grow(plot, seats, queue, room, pull):
    """Place points in the triangles of a queue, at most `room[p]` in patch p, which counts down; those that
    have changed meanwhile have to wait until colours have adapted."""
    for t in queue:
        patch = plot.patch[t]
        if plot.gain[t] <= 0.0 or room[patch] == 0 or plot.counts[VERTICES] + 1 >= len(plot.domain):
            continue
        n_new = _place(plot, seats, t, plot.holes, pull)
        plot.gain[t] = 0.0
        for i in range(n_new):
            plot.gain[plot.holes[i]] = 0.0
        if n_new > 0:
            room[patch] -= 1


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
    """Take out the vertices whose usefulness is not above the `limit` `(patches,)` of their patch."""
    for v in range(len(use)):
        if not plot.whole[v] or use[v] > limit[plot.patch[plot.at_vertex[v]]]:
            continue
        if remove(plot, v, plot.holes) > 0:
            plot.whole[v] = False
            plot.seat[v] = NOBODY


class Placement:
    """Placing control points on one mesh, until the next one is made.

    plots   strips of the picture
    error   squared error of the picture as it is, in [0, 1] colours, summed over pixels and channels
    lack    how much of it there is because patches may have no more points: what the others cannot make up
            for, however many points are spent there
    """

    def __init__(self, plots: list[Plot], seats: Seats, error: float, room: Ints | None, pull: float) -> None:
        """`room` `(patches,)` is how many more points each patch may have, None: any number. `pull` is w of
        equation (7)."""
        self.plots = plots
        self._seats = seats
        self._elsewhere = 0.0
        self._room = room
        self._pull = pull
        # Patches may be so thin that they hold the centre of no pixel.
        self._n_patches = int(seats.patch.max()) + 1 if room is None else len(room)
        self._stuck = np.zeros(self._n_patches, bool)
        self._first_new = [int(plot.counts[VERTICES]) for plot in plots]
        self.error, self.lack = error, 0.0
        # Where strips overlap each sees its own changes only.
        self._elsewhere = error - sum(in_turn(lambda plot: _square(plot.residual), plots))

    def thin_out(self, share: float) -> None:
        """Take out the least useful `share` of the points, all over the picture, and of each patch that may
        have no more by itself; their seats stay taken."""
        if not share:
            return
        rated = [np.empty(plot.counts[VERTICES]) for plot in self.plots]
        pairs = list(zip(self.plots, rated, strict=True))
        in_turn(lambda pair: _rate(*pair), pairs)
        patches = [plot.patch[plot.at_vertex[: len(use)]] for plot, use in pairs]
        limit = self._limits(np.concatenate(rated), np.concatenate(patches), share)
        in_turn(lambda pair: _thin(*pair, limit), pairs)
        if self._room is not None:
            for (plot, use), patch in zip(pairs, patches, strict=True):
                gone = np.isfinite(use) & (plot.seat[: len(use)] == NOBODY)
                self._room += np.bincount(patch[gone], minlength=self._n_patches)
        self.settle()

    def _limits(self, use: Floats, patch: Ints, share: float) -> Floats:
        """`(patches,)` up to which usefulness points go, if this share of them shall."""
        full = np.zeros(self._n_patches, bool) if self._room is None else self._room == 0
        movable = np.isfinite(use)
        limit = np.full(self._n_patches, _least(use[movable & ~full[patch]], share))
        for p in np.flatnonzero(full):
            limit[p] = _least(use[movable & (patch == p)], share)
        return limit

    def settle(self) -> None:
        """Let colours adapt."""
        self.error = self._elsewhere + sum(in_turn(lambda plot: _settle(plot, self._pull), self.plots))

    def grow(self, goal: float, most: int) -> bool:
        """Place points until the error is `goal` or less, about `most` are placed, or plots have no room for
        more. False: no more points help.

        What patches lack that may have no more points is not asked of the others (see `lack`).
        """
        placed = 0

        def enough(missing: float) -> bool:
            return missing <= NEAR_ENOUGH * goal or placed >= NEARLY * most

        for _ in range(MOST_LEVELS):
            if self._room is None and enough(self.error - goal):
                return True
            queues, full = self._queues()
            gain = np.sort(np.concatenate([q.gain for q in queues]))[::-1]
            missing = full.missing(self.error, goal, gain[0] if len(gain) else 0.0)
            self.lack = self.error - goal - missing
            if not len(gain):
                return enough(self.error - goal)
            if enough(missing):
                return True
            wanted = int(EAGER * how_many(gain, partial(full.missing, self.error, goal)))
            wanted = max(min(wanted, int(EAGER * (most - placed))), 1)
            threshold = float(gain[wanted]) if wanted < len(gain) else 0.0
            new, stuck = self._place([self._best(q, threshold) for q in queues])
            if not new and not stuck:
                return any(plot.counts[VERTICES] + 1 >= len(plot.domain) for plot in self.plots)
            placed += new
            self.settle()
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

    def _queues(self) -> tuple[list[Queue], Full]:
        """For each plot the triangles where a point would save something and may be, and the patches that may
        have no more points."""

        def look(plot: Plot) -> Queue:
            look_everywhere(plot, self._seats)
            return useful(plot)

        queues = in_turn(look, self.plots)
        if self._room is None:
            return queues, NONE_FULL
        gain = np.concatenate([q.gain for q in queues])
        patch = np.concatenate([q.patch for q in queues])
        order, rank = np.argsort(-gain, kind="stable"), np.empty(len(gain), np.int64)
        rank[order] = rank_in_group(patch[order])
        cuts = np.cumsum([len(q.gain) for q in queues])[:-1]
        ranked = [q._replace(rank=own) for q, own in zip(queues, np.split(rank, cuts), strict=True)]
        full = self._room == 0
        still_open = [q.where(~(full | self._stuck)[q.patch]) for q in ranked]
        if not full.any():
            return still_open, NONE_FULL
        price = np.zeros(self._n_patches)
        np.maximum.at(price, patch, gain)
        owner = self._seats.patch[self._seats.triangle_at >= 0]
        area = np.bincount(owner, minlength=self._n_patches)
        found = Full(self._squares()[full], price[full], float(area[full].sum() / area.sum()))
        return still_open, found

    def _squares(self) -> Floats:
        """`(patches,)` squared errors."""
        total = np.zeros(self._n_patches)
        for plot in self.plots:
            own = slice(plot.first_row * plot.width, (plot.first_row + plot.rows) * plot.width)
            total += np.bincount(self._seats.patch[own], (plot.residual**2).sum(axis=1), self._n_patches)
        return total

    def _best(self, queue: Queue, threshold: float) -> Ints:
        """The triangles of a queue to place points in now, no more of a patch than it may have points, the
        most promising first."""
        wanted = queue.gain > threshold
        if self._room is not None:
            wanted &= queue.rank < self._room[queue.patch]
        chosen = queue.where(wanted)
        return chosen.triangle[np.argsort(-chosen.gain, kind="stable")]

    def _place(self, queues: list[Ints]) -> tuple[int, bool]:
        """Place points in these triangles of each plot. How many, and whether a patch that has a bound has
        got none of them: it is asked no more then."""

        def grow(pair: tuple[Plot, Ints]) -> tuple[Ints, Ints]:
            plot, queue = pair
            asked = np.bincount(plot.patch[queue], minlength=self._n_patches)
            left = asked.copy()
            _grow(plot, self._seats, queue, left, self._pull)
            return asked, asked - left

        asked, used = np.sum(in_turn(grow, list(zip(self.plots, queues, strict=True))), axis=0)
        if self._room is None:
            return int(used.sum()), False
        self._room -= used
        stuck = (asked > 0) & (used == 0)
        self._stuck |= stuck
        return int(used.sum()), bool(stuck.any())


def _least(use: Floats, share: float) -> float:
    """The usefulness of the most useful one of this share of the points."""
    fewer = int(share * len(use))
    return float(np.partition(use, fewer - 1)[fewer - 1]) if fewer else -np.inf
