"""Real corners of borders: where two straight sides explain the samples better than one smooth arc does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.chains import Chains
from gcvec.borders.line_fit import fit_line
from gcvec.borders.profile import step_shifts
from gcvec.kernels import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIDES = (4, 6, 9)
"""Samples of a side, from the finest scale to the coarsest."""

GAP = 1
"""Samples next to the corner that belong to no side: the photo's blur rounds them."""

LEAST_TURN = np.deg2rad(30.0)
"""Where a border turns by less it is not cut: one spline follows it."""

SURE_ERROR, UNSURE_ERROR = 0.08, 0.25
"""Standard deviations of samples that the photo shows, and of those that only the label map knows, pixels."""

BLUR, ROUNDING = 0.8, 0.45
"""Blur alone moves the middle of a sharp corner inwards by so much, pixels, times 1 / sin(half its angle)
- 1; more by this, and the corner is a bend."""

LEAST_GAIN = 3.0
"""A smooth arc must leave so many times the squared distance that two sides leave."""

FARTHEST = 1.0
"""A corner lies where its sides meet, unless that is so far from the border, pixels."""


class Corners(NamedTuple):
    """Samples between which and the next a border turns, `(n,)`, and the corners' places, `(n, 2)`."""

    after: Ints
    places: Floats


def corners(chains: Chains, points: Floats, trust: Floats, picture: Floats) -> Corners:
    """The corners of the chains through `points` `(n, 2)`, each of them known by `trust` `(n,)`."""
    best, apex, inward = np.zeros(len(points)), np.zeros((len(points), 2)), np.zeros((len(points), 2))
    for side in SIDES:
        gain, own_apex, own_inward = corner_gains(points, trust, chains.offsets, chains.closed, side)
        better = gain > best
        best = np.where(better, gain, best)
        apex = np.where(better[:, None], own_apex, apex)
        inward = np.where(better[:, None], own_inward, inward)
    sharpest = best >= LEAST_GAIN
    for k in range(1, SIDES[0] + 1):
        for steps in (-k, k):
            other, there = chains.along(steps)
            rival = np.where(there, best[other], 0)
            sharpest &= (best > rival) if steps < 0 else (best >= rival)
    found = np.flatnonzero(sharpest)
    found = found[~_blunt(apex[found], inward[found], picture)]
    return _at_apexes(chains, points, found, apex[found])


def _at_apexes(chains: Chains, points: Floats, found: Ints, apex: Floats) -> Corners:
    """The corners found near some samples, where the chains come nearest to their apexes `(n, 2)`.

    Seen from a few samples off, with more of one side than of the other, a corner is even less like a
    parabola.
    """
    following, there = chains.along(1)
    between = there & ~chains.at_node & ~chains.at_node[following]
    middle = (points + points[following]) / 2
    steps = range(-SIDES[0], SIDES[0] + 1)
    near = np.stack([chains.along(k)[0][found] for k in steps])
    reached = np.stack([chains.along(k)[1][found] for k in steps])
    away = np.hypot(*np.moveaxis(middle[near] - apex, -1, 0))
    nearest = np.argmin(np.where(reached & between[near], away, np.inf), axis=0)
    after, first = np.unique(near[nearest, np.arange(len(found))], return_index=True)
    meet = np.hypot(*(apex[first] - middle[after]).T) < FARTHEST
    return Corners(after, np.where(meet[:, None], apex[first], middle[after]))


def _blunt(apex: Floats, inward: Floats, picture: Floats) -> NDArray[np.bool_]:
    """Which corners the picture shows round: the step lies deeper inside the apex than blur can explain.

    `inward` `(n, 2)` halves the angle; its length is the sine of half that angle.
    """
    sine = np.hypot(*inward.T)
    broad = np.zeros((len(apex), 2), bool)
    depth, trust, _ = step_shifts(picture, apex, inward / np.maximum(sine, 1e-12)[:, None], broad)
    sharp = BLUR * (1 / np.maximum(sine, 0.2) - 1)
    # No depth is no evidence: it compares as false.
    return np.asarray((trust > 0.5) & (depth > sharp + ROUNDING))


@kernel
def corner_gains(points, trust, offsets, closed, side):
    """How many times more a parabola leaves than two lines through `side` samples each do, `(n,)`, 0 where
    there is no corner to see; where the lines meet, `(n, 2)`, and the direction that halves their angle, as
    long as the sine of half of it.

    The sides lie `GAP` samples before a sample and after the next, on the chains that begin at `offsets`.
    """
    n = len(points)
    gains, apexes, inward = np.zeros(n), np.zeros((n, 2)), np.zeros((n, 2))
    near = np.empty((2 * side, 2))
    u, v, middle, other_middle = np.empty(2), np.empty(2), np.empty(2), np.empty(2)
    for chain in range(len(closed)):
        first, size = offsets[chain], offsets[chain + 1] - offsets[chain]
        reach = GAP + side
        # On open chains both ends are nodes, which belong to no side.
        start, stop = (0, size) if closed[chain] else (reach, size - reach - 1)
        if closed[chain] and 2 * reach >= size:
            continue
        for k in range(start, stop):
            sure = 0.0
            for i in range(side):
                before, after = first + (k - reach + 1 + i) % size, first + (k + GAP + 1 + i) % size
                near[i], near[side + i] = points[before], points[after]
                sure += (trust[before] + trust[after]) / (2 * side)
            lines = fit_line(near[:side], u, middle) + fit_line(near[side:], v, other_middle)
            cosine = min(max(u[0] * v[0] + u[1] * v[1], -1.0), 1.0)
            error = 2 * side * (sure * SURE_ERROR**2 + (1 - sure) * UNSURE_ERROR**2)
            if cosine > np.cos(LEAST_TURN) or lines > 4 * error:
                continue
            j = first + k
            gains[j] = _left_by_parabola(near) / (lines + error)
            cross = u[0] * v[1] - u[1] * v[0]
            cross = 1e-9 if abs(cross) < 1e-9 else cross
            way_x, way_y = other_middle[0] - middle[0], other_middle[1] - middle[1]
            along = (way_x * v[1] - way_y * v[0]) / cross
            half = np.sqrt((1 + cosine) / 2)
            length = max(np.hypot(v[0] - u[0], v[1] - u[1]), 1e-12)
            for c in range(2):
                apexes[j, c] = middle[c] + along * u[c]
                inward[j, c] = (v[c] - u[c]) * half / length
    return gains, apexes, inward


@kernel
def _left_by_parabola(points):
    """Squared distances of points `(k, 2)` from a parabola over their chord.

    By Gram-Schmidt on 1, s, s² at the samples' places s along the chord.
    """
    k = len(points)
    way_x, way_y = points[k - 1, 0] - points[0, 0], points[k - 1, 1] - points[0, 1]
    length = max(np.hypot(way_x, way_y), 1e-12)
    way_x, way_y = way_x / length, way_y / length
    x0, y0 = points[:, 0].mean(), points[:, 1].mean()
    s, d, q = np.empty(k), np.empty(k), np.empty(k)
    square, mean, skew, slope = 0.0, 0.0, 0.0, 0.0
    for i in range(k):
        x, y = points[i, 0] - x0, points[i, 1] - y0
        s[i], d[i] = x * way_x + y * way_y, y * way_x - x * way_y
        square += s[i] ** 2
        skew += s[i] ** 3
        slope += s[i] * d[i]
        mean += s[i] ** 2 / k
    square = max(square, 1e-12)
    along, energy = 0.0, 1e-12
    for i in range(k):
        q[i] = s[i] ** 2 - mean - skew / square * s[i]
        along += q[i] * d[i]
        energy += q[i] ** 2
    left = 0.0
    for i in range(k):
        left += (d[i] - slope / square * s[i] - along / energy * q[i]) ** 2
    return left
