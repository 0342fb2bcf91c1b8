"""Real corners of borders: where two straight sides explain the samples better than one smooth arc does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders import Border, Borders, Loop, with_nodes_in_order
from gcvec.chains import Chains, chains_of
from gcvec.profile import step_shifts

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIDES = (4, 6, 9)
"""Samples of a side, from the finest scale to the coarsest."""

GAP = 1
"""Samples next to the corner that belong to no side: the photo's blur rounds them."""

LEAST_TURN = np.deg2rad(30.0)
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
        gain, own_apex, own_inward = _gain(chains, points, trust, side)
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


def _gain(chains: Chains, points: Floats, trust: Floats, side: int) -> tuple[Floats, Floats, Floats]:
    """How many times more a parabola leaves than two lines do, `(n,)`, 0 where there is no corner to see;
    where the lines meet, `(n, 2)`, and the direction that halves their angle, as long as the sine of half of
    it.
    """
    places = [chains.along(-k) for k in range(GAP + side - 1, GAP - 1, -1)]
    places += [chains.along(k) for k in range(GAP + 1, GAP + side + 1)]
    index = np.stack([place for place, _ in places], axis=1)
    there = np.all([there for _, there in places], axis=0) & ~chains.at_node[index].any(axis=1)
    seen = np.flatnonzero(there)
    near = points[index[seen]]
    before, after = near[:, :side], near[:, side:]
    direction, left = _line(before)
    other, right = _line(after)
    turn = np.arccos(np.clip((direction * other).sum(axis=1), -1, 1))
    lines = left + right
    sure = trust[index[seen]].mean(axis=1)
    error = 2 * side * (sure * SURE_ERROR**2 + (1 - sure) * UNSURE_ERROR**2)
    gain = _parabola(near) / (lines + error)
    gain[(turn < LEAST_TURN) | (lines > 4 * error)] = 0
    apex = _crossing(before.mean(axis=1), direction, after.mean(axis=1), other)
    half = np.cos(turn / 2)
    inward = other - direction
    inward *= (half / np.maximum(np.hypot(*inward.T), 1e-12))[:, None]
    result = np.zeros(len(points)), np.zeros((len(points), 2)), np.zeros((len(points), 2))
    for whole, part in zip(result, (gain, apex, inward), strict=True):
        whole[seen] = part
    return result


def _crossing(a: Floats, u: Floats, b: Floats, v: Floats) -> Floats:
    """Where the lines through a along u and through b along v meet, `(n, 2)`."""
    cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    along = (b - a)[:, 0] * v[:, 1] - (b - a)[:, 1] * v[:, 0]
    return np.asarray(a + (along / np.where(np.abs(cross) < 1e-9, 1e-9, cross))[:, None] * u)


def _line(points: Floats) -> tuple[Floats, Floats]:
    """Directions `(n, 2)` of the lines through rows of points `(n, k, 2)`, and squared distances from it."""
    x, y = np.moveaxis(points - points.mean(axis=1, keepdims=True), -1, 0)
    xx, xy, yy = (x * x).sum(axis=1), (x * y).sum(axis=1), (y * y).sum(axis=1)
    angle = np.arctan2(2 * xy, xx - yy) / 2
    direction = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    way = points[:, -1] - points[:, 0]
    direction *= np.where((direction * way).sum(axis=1) < 0, -1.0, 1.0)[:, None]
    rest = (xx + yy - np.hypot(xx - yy, 2 * xy)) / 2
    return direction, np.maximum(rest, 0)


def _parabola(points: Floats) -> Floats:
    """Squared distances `(n,)` of rows of points `(n, k, 2)` from parabolas over the rows' chords."""
    way = points[:, -1] - points[:, 0]
    way /= np.maximum(np.hypot(*way.T), 1e-12)[:, None]
    off = points - points.mean(axis=1, keepdims=True)
    s = (off * way[:, None]).sum(axis=-1)
    d = off[..., 1] * way[:, None, 0] - off[..., 0] * way[:, None, 1]
    design = np.stack([np.ones_like(s), s, s * s], axis=-1)
    matrix = np.einsum("nki,nkj->nij", design, design) + 1e-9 * np.eye(3)
    right = np.einsum("nki,nk->ni", design, d)
    fitted = np.linalg.solve(matrix, right[..., None])[..., 0]
    return np.asarray(((d - np.einsum("nki,ni->nk", design, fitted)) ** 2).sum(axis=1))


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
        replace(
            border,
            samples=np.concatenate([[nodes[a]], samples[first:last], [nodes[b]]]),
            trust=np.concatenate([[0.0], trust[first:last], [0.0]]),
            start=a,
            end=b,
        )
        for a, b, first, last in zip(numbers[:-1], numbers[1:], stops[:-1], stops[1:], strict=True)
    ]
