"""Real corners of borders: where two straight sides explain the samples better than one smooth arc does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Border, Borders, with_nodes_in_order
from gcvec.borders.chains import Chains, chains_of
from gcvec.borders.planar_graph import Loop
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


def cut_at_corners(traced: Borders, placed: Borders, picture: Floats) -> tuple[Borders, Borders]:
    """Both with their borders cut, between the same samples, where `placed` turns corners that the picture
    shows sharp.

    The new nodes lie on the lattice in the first, between their neighbours in the second.
    """
    chains = chains_of(placed)
    cuts = _cuts(chains, placed, picture)
    return _cut(traced, cuts, _lattice_point), _cut(placed, cuts, lambda a, b: (a + b) / 2)


def _cuts(chains: Chains, placed: Borders, picture: Floats) -> dict[int, list[int]]:
    """For every border with corners, the samples after which they come, in order."""
    points = chains.joined([b.samples for b in placed.borders])
    trust = chains.joined([b.trust[:, None] for b in placed.borders])[:, 0]
    cuts: dict[int, list[int]] = {}
    for k in corners(chains, points, trust, picture):
        chain = chains.of_sample[k]
        cuts.setdefault(int(chains.which[chain]), []).append(int(k - chains.offsets[chain]))
    return cuts


def corners(chains: Chains, points: Floats, trust: Floats, picture: Floats) -> Ints:
    """Samples between which and the next a chain turns a corner."""
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
    return found[~_blunt(apex[found], inward[found], picture)]


def _blunt(apex: Floats, inward: Floats, picture: Floats) -> NDArray[np.bool_]:
    """Which corners the picture shows round: the step lies deeper inside the apex than blur can explain.

    `inward` `(n, 2)` halves the angle; its length is the sine of half that angle.
    """
    sine = np.hypot(*inward.T)
    depth, trust, _ = step_shifts(picture, apex, inward / np.maximum(sine, 1e-12)[:, None])
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
            lines = _line(near[:side], u, middle) + _line(near[side:], v, other_middle)
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
def _line(points, direction, middle):
    """The line through points `(k, 2)`: fills its direction and a point on it; returns the squared distances
    left."""
    k = len(points)
    middle[0], middle[1] = points[:, 0].mean(), points[:, 1].mean()
    xx, xy, yy = 0.0, 0.0, 0.0
    for i in range(k):
        x, y = points[i, 0] - middle[0], points[i, 1] - middle[1]
        xx += x * x
        xy += x * y
        yy += y * y
    angle = np.arctan2(2 * xy, xx - yy) / 2
    dx, dy = np.cos(angle), np.sin(angle)
    if dx * (points[k - 1, 0] - points[0, 0]) + dy * (points[k - 1, 1] - points[0, 1]) < 0:
        dx, dy = -dx, -dy
    direction[0], direction[1] = dx, dy
    return max((xx + yy - np.hypot(xx - yy, 2 * xy)) / 2, 0.0)


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


def _lattice_point(a: Floats, b: Floats) -> Floats:
    """The lattice point between two consecutive cracks' mid-points."""
    return np.where(a == np.round(a), a, np.where(b == np.round(b), b, (a + b) / 2))


def _cut(found: Borders, cuts: dict[int, list[int]], place: Callable[[Floats, Floats], Floats]) -> Borders:
    nodes = list(found.nodes)
    pieces: list[Border] = []
    pieces_of: list[list[int]] = []
    for k, border in enumerate(found.borders):
        own = _pieces(border, cuts.get(k, []), nodes, place)
        pieces_of.append(list(range(len(pieces), len(pieces) + len(own))))
        pieces += own

    def walked(loop: Loop) -> Loop:
        return tuple((c, fwd) for a, fwd in loop for c in (pieces_of[a] if fwd else pieces_of[a][::-1]))

    loops = tuple(tuple(walked(loop) for loop in region) for region in found.loops)
    return with_nodes_in_order(replace(found, nodes=np.array(nodes), borders=tuple(pieces), loops=loops))


def _pieces(
    border: Border, cuts: list[int], nodes: list[Floats], place: Callable[[Floats, Floats], Floats]
) -> list[Border]:
    """A border cut after some of its samples; new nodes are appended to `nodes`."""
    if not cuts:
        return [border]
    samples, trust = border.samples, border.trust
    corner = [place(samples[k], samples[k + 1]) for k in cuts]
    numbers = list(range(len(nodes), len(nodes) + len(corner)))
    nodes += corner
    if border.closed:
        # Walk from the first corner once around to it.
        samples = np.concatenate([samples[cuts[0] + 1 : -1], samples[: cuts[0] + 1]])
        trust = np.concatenate([trust[cuts[0] + 1 : -1], trust[: cuts[0] + 1]])
        stops = [0, *(k - cuts[0] for k in cuts[1:]), len(samples)]
        numbers.append(numbers[0])
    else:
        samples, trust = samples[1:-1], trust[1:-1]
        stops = [0, *cuts, len(samples)]
        numbers = [border.start, *numbers, border.end]
    return [
        Border(
            np.concatenate([[nodes[a]], samples[first:last], [nodes[b]]]),
            np.concatenate([[0.0], trust[first:last], [0.0]]),
            border.left,
            border.right,
            a,
            b,
        )
        for a, b, first, last in zip(numbers[:-1], numbers[1:], stops[:-1], stops[1:], strict=True)
    ]
