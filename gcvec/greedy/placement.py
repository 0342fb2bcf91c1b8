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
from gcvec.greedy.queues import NONE_FULL, FullPatches, Queue, how_many, useful
from gcvec.greedy.seats import Seats, image_of
from gcvec.greedy.strip import (
    CANDIDATES,
    EXHAUSTED,
    NOBODY,
    TRIANGLES,
    VERTICES,
    Strip,
    make_room,
)
from gcvec.grouping import rank_in_group
from gcvec.kernels import bare_kernel
from gcvec.parallel import in_turn
from gcvec.patches.mesh import jittered
from gcvec.raster.triangle import barycentric

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_COVER = 0.3
"""A pixel can become a control point of a triangle that covers at least this share of it."""

LEAST_MARGIN = 0.02
"""Least weight of a triangle's corner at a new control point."""

EAGER = 0.3
"""With each threshold this share of the points is placed that the error seems to ask for: the best ones."""

DULL = 0.5
"""Triangles where a point would save less than this share of the last threshold, before colours adapted, are
not next: they are looked at again when thresholds have fallen."""

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
def look_everywhere(strip, seats, least):
    """Look at every triangle that is new, or where something has changed and a point may save `least`."""
    offset = strip.first_row * strip.width
    for t in range(strip.counts[TRIANGLES]):
        if not strip.stale[t] or strip.triangles[t, 0] == NOBODY or 0.0 < strip.gain[t] < least:
            continue
        strip.stale[t] = False
        strip.gain[t], strip.best[t] = _look(
            strip.first[t], strip.last[t], strip.pixel, strip.weights, strip.residual,
            seats.under, seats.taken, seats.patch, strip.patch[t], offset, strip.worst, strip.candidate,
        )  # fmt: skip


@bare_kernel
def _settle(strip, pull):
    for v in range(strip.counts[VERTICES]):
        if strip.whole[v] and strip.restless[v]:
            adapt(strip, v, pull)
    return _square(strip.residual)


@bare_kernel
def _square(residual):
    total = 0.0
    for pixel in range(len(residual)):
        for k in range(3):
            total += residual[pixel, k] ** 2
    return total


@bare_kernel
def _grow(strip, seats, queue, room, pull):
    """Place points in the triangles of a queue, at most `room[p]` in patch p, which counts down, as long as
    the strip has room; those that have changed meanwhile have to wait until colours have adapted."""
    in_vain = False
    for t in queue:
        in_vain = make_room(strip, in_vain)
        if strip.counts[VERTICES] + 1 >= len(strip.domain):
            strip.counts[EXHAUSTED] = 1
        if strip.counts[EXHAUSTED]:
            return
        patch = strip.patch[t]
        if strip.gain[t] <= 0.0 or room[patch] == 0:
            continue
        n_new = _place(strip, seats, t, pull)
        strip.gain[t] = 0.0
        for i in range(n_new):
            strip.gain[strip.holes[i]] = 0.0
        if n_new > 0:
            room[patch] -= 1


@bare_kernel
def _place(strip, seats, t, pull):
    """Put a control point where it saves most in a triangle; its new triangles are `strip.holes[:n]`, n is
    returned."""
    pixel = strip.best[t]
    at = seats.under[pixel + strip.first_row * strip.width]
    if seats.taken[at]:
        return 0
    v = strip.counts[VERTICES]
    x, y = jittered(at % seats.width + seats.column, at // seats.width + seats.row)
    x, y = x - seats.column, y - seats.row
    strip.domain[v, 0], strip.domain[v, 1] = x, y
    strip.image[v, 0], strip.image[v, 1] = image_of(seats, x, y, at)
    a, b, c = strip.triangles[t, 0], strip.triangles[t, 1], strip.triangles[t, 2]
    w0, w1, w2 = barycentric(strip.image, a, b, c, strip.image[v, 0], strip.image[v, 1])
    for k in range(3):
        color = w0 * strip.color[a, k] + w1 * strip.color[b, k] + w2 * strip.color[c, k]
        strip.color[v, k] = min(max(color, 0.0), 1.0)
    n_new = insert(strip, v, t)
    if n_new > 0:
        strip.counts[VERTICES] += 1
        strip.seat[v] = at
        strip.whole[v] = True
        seats.taken[at] = True
        adapt(strip, v, pull)
    return n_new


@bare_kernel
def _rate(strip, use):
    """Usefulness of every vertex, infinite for those that cannot be taken out."""
    for v in range(len(use)):
        use[v] = usefulness(strip, v) if strip.whole[v] else np.inf


@bare_kernel
def _thin(strip, use, limit):
    """Take out the vertices whose usefulness is not above the `limit` `(patches,)` of their patch."""
    in_vain = False
    for v in range(len(use)):
        if not strip.whole[v] or use[v] > limit[strip.patch[strip.at_vertex[v]]]:
            continue
        in_vain = make_room(strip, in_vain)
        if remove(strip, v) > 0:
            strip.whole[v] = False
            strip.seat[v] = NOBODY


class Placement:
    """Placing control points on one mesh, until the next one is made.

    strips   strips of the picture
    error   squared error of the picture as it is, in [0, 1] colours, summed over pixels and channels
    lack    how much of it there is because patches may have no more points: what the others cannot make up
            for, however many points are spent there
    """

    def __init__(
        self,
        strips: list[Strip],
        seats: Seats,
        n_patches: int,
        error: float,
        room: Ints | None,
        pull: float,
    ) -> None:
        """`room` `(patches,)` is how many more points each patch may have, None: any number. `pull` is w of
        equation (7)."""
        self.strips = strips
        self._seats = seats
        self._room = room
        self._pull = pull
        self._n_patches = n_patches
        self._threshold = 0.0
        self._first_new = [int(strip.counts[VERTICES]) for strip in strips]
        self.error, self.lack = error, 0.0
        # Where strips overlap each sees its own changes only.
        self._elsewhere = error - sum(in_turn(lambda strip: _square(strip.residual), strips))

    def thin_out(self, share: float) -> None:
        """Take out the least useful `share` of the points, all over the picture, and of each patch that may
        have no more by itself; their seats stay taken."""
        if not share:
            return
        rated = [np.empty(strip.counts[VERTICES]) for strip in self.strips]
        pairs = list(zip(self.strips, rated, strict=True))
        in_turn(lambda pair: _rate(*pair), pairs)
        patches = [strip.patch[strip.at_vertex[: len(use)]] for strip, use in pairs]
        limit = self._limits(np.concatenate(rated), np.concatenate(patches), share)

        def thin(pair: tuple[Strip, Floats]) -> float:
            _thin(*pair, limit)
            return self._settled(pair[0])

        self.error = self._elsewhere + sum(in_turn(thin, pairs))
        if self._room is not None:
            for (strip, use), patch in zip(pairs, patches, strict=True):
                gone = np.isfinite(use) & (strip.seat[: len(use)] == NOBODY)
                self._room += np.bincount(patch[gone], minlength=self._n_patches)

    def _settled(self, strip: Strip) -> float:
        """The squared error of a strip after its colours have adapted."""
        return float(_settle(strip, self._pull))

    def _limits(self, use: Floats, patch: Ints, share: float) -> Floats:
        """`(patches,)` up to which usefulness points go, if this share of them shall."""
        is_full = np.zeros(self._n_patches, bool) if self._room is None else self._room == 0
        movable = np.isfinite(use)
        limit = np.full(self._n_patches, _least(use[movable & ~is_full[patch]], share))
        for p in np.flatnonzero(is_full):
            limit[p] = _least(use[movable & (patch == p)], share)
        return limit

    def grow(self, goal: float, most: int) -> bool:
        """Place points until the error is `goal` or less, about `most` are placed, or strips have no room for
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
            self._threshold = float(gain[wanted]) if wanted < len(gain) else 0.0
            asked, new = self._place(queues)
            if not asked:
                return any(strip.counts[EXHAUSTED] for strip in self.strips)
            placed += new
        return True

    def result(self) -> tuple[Ints, Floats, NDArray[np.bool_]]:
        """Control points `(n, 2)` as pixels of the domain, their colours, and which ones are new; by rows."""
        held = [np.flatnonzero(strip.seat[: strip.counts[VERTICES]] >= 0) for strip in self.strips]
        seats = [strip.seat[own] for strip, own in zip(self.strips, held, strict=True)]
        color = np.concatenate([strip.color[own] for strip, own in zip(self.strips, held, strict=True)])
        new = np.concatenate([own >= first for own, first in zip(held, self._first_new, strict=True)])
        # Those along the cuts are in several strips.
        seat, one = np.unique(np.concatenate(seats).astype(np.int64), return_index=True)
        return np.stack([seat % self._seats.width, seat // self._seats.width], axis=1), color[one], new[one]

    def _queues(self) -> tuple[list[Queue], FullPatches]:
        """For each strip the triangles where a point would save something and may be, and the patches that
        may have no more points."""

        def look(strip: Strip) -> Queue:
            look_everywhere(strip, self._seats, DULL * self._threshold)
            return useful(strip)

        queues = in_turn(look, self.strips)
        if self._room is None:
            return queues, NONE_FULL
        gain = np.concatenate([q.gain for q in queues])
        patch = np.concatenate([q.patch for q in queues])
        order, rank = np.argsort(-gain, kind="stable"), np.empty(len(gain), np.int64)
        rank[order] = rank_in_group(patch[order])
        cuts = np.cumsum([len(q.gain) for q in queues])[:-1]
        ranked = [q._replace(rank=own) for q, own in zip(queues, np.split(rank, cuts), strict=True)]
        is_full = self._room == 0
        still_open = [q.where(~is_full[q.patch]) for q in ranked]
        if not is_full.any():
            return still_open, NONE_FULL
        price = np.zeros(self._n_patches)
        np.maximum.at(price, patch, gain)
        owner = self._seats.patch[self._seats.triangle_at >= 0]
        area = np.bincount(owner, minlength=self._n_patches)
        share = float(area[is_full].sum() / area.sum())
        return still_open, FullPatches(self._squares()[is_full], price[is_full], share)

    def _squares(self) -> Floats:
        """`(patches,)` squared errors."""
        total = np.zeros(self._n_patches)
        for strip in self.strips:
            own = slice(strip.first_row * strip.width, (strip.first_row + strip.rows) * strip.width)
            total += np.bincount(self._seats.patch[own], (strip.residual**2).sum(axis=1), self._n_patches)
        return total

    def _best(self, queue: Queue) -> Ints:
        """The triangles of a queue to place points in now, no more of a patch than it may have points, the
        most promising first."""
        wanted = queue.gain > self._threshold
        if self._room is not None:
            wanted &= queue.rank < self._room[queue.patch]
        chosen = queue.where(wanted)
        return chosen.triangle[np.argsort(-chosen.gain, kind="stable")]

    def _place(self, queues: list[Queue]) -> tuple[int, int]:
        """Place points in the best triangles of each strip, and let colours adapt. How many triangles were
        asked, in strips that are not exhausted, and how many took a point: those that did not are asked no
        more.
        """

        def grow(pair: tuple[Strip, Queue]) -> tuple[int, Ints, float]:
            strip, queue = pair[0], self._best(pair[1])
            asked = np.bincount(strip.patch[queue], minlength=self._n_patches)
            left = asked.copy()
            _grow(strip, self._seats, queue, left, self._pull)
            used = asked - left
            return int((used if strip.counts[EXHAUSTED] else asked).sum()), used, self._settled(strip)

        grown = in_turn(grow, list(zip(self.strips, queues, strict=True)))
        used = np.sum([new for _, new, _ in grown], axis=0)
        self.error = self._elsewhere + sum(square for *_, square in grown)
        if self._room is not None:
            self._room -= used
        return sum(asked for asked, *_ in grown), int(used.sum())


def _least(use: Floats, share: float) -> float:
    """The usefulness of the most useful one of this share of the points."""
    fewer = int(share * len(use))
    return float(np.partition(use, fewer - 1)[fewer - 1]) if fewer else -np.inf
