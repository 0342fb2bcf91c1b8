"""Borders cut where they turn, so that each piece is smooth and its ends are nodes."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Border, Borders, with_nodes_in_order
from gcvec.borders.chains import Chains, chains_of
from gcvec.borders.corners import SIDES, Corners, corners
from gcvec.borders.planar_graph import Loop
from gcvec.borders.stroke_ends import StrokeEnds, stroke_ends

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class Turn(NamedTuple):
    """A sample of a border after which it turns, and the place of the node there."""

    after: int
    place: Floats


def cut_at_corners(
    traced: Borders, placed: Borders, picture: Floats, largest_shift: float
) -> tuple[Borders, Borders]:
    """Both with their borders cut, between the same samples, where `placed` turns corners that the picture
    shows sharp; it moves no end of a stroke further than `largest_shift` pixels.

    The new nodes lie on the lattice in the first, where the sides of the corners meet in the second.
    """
    turns = _turns(placed, picture, largest_shift)
    on_lattice = {
        k: [Turn(turn.after, _lattice_point(traced.borders[k].samples, turn.after)) for turn in own]
        for k, own in turns.items()
    }
    return _cut(traced, on_lattice), _cut(placed, turns)


def _turns(placed: Borders, picture: Floats, largest_shift: float) -> dict[int, list[Turn]]:
    """Of every border with corners all of them, in order."""
    chains = chains_of(placed)
    points = chains.joined([b.samples for b in placed.borders])
    trust = chains.joined([b.trust[:, None] for b in placed.borders])[:, 0]
    single = corners(chains, points, trust, picture)
    ends = stroke_ends(chains, points, picture, largest_shift)
    alone, needed = _told_once(chains, single, ends)
    after = np.concatenate([single.after[alone], ends.after[needed].ravel()])
    places = np.concatenate([single.places[alone], ends.places[needed].reshape(-1, 2)])
    order = np.argsort(after)
    turns: dict[int, list[Turn]] = {}
    for k, place in zip(after[order].tolist(), places[order], strict=True):
        chain = chains.of_sample[k]
        turns.setdefault(int(chains.which[chain]), []).append(Turn(k - int(chains.offsets[chain]), place))
    return turns


def _told_once(chains: Chains, single: Corners, ends: StrokeEnds) -> tuple[Flags, Flags]:
    """Which corners and which ends of strokes to cut at, where both may tell of the same.

    If both corners of an end are seen by themselves, they are known better so.
    """
    first, size = chains.first, chains.size
    alone, needed = np.ones(len(single.after), bool), np.ones(len(ends.after), bool)
    for i, (start, end) in enumerate(ends.after):
        ahead = (single.after - start + SIDES[0]) % size[start]
        there = first[single.after] == first[start]
        there &= ahead <= (end - start) % size[start] + 2 * SIDES[0]
        needed[i] = there.sum() < 2
        alone &= ~(there & needed[i])
    return alone, needed


def _lattice_point(samples: Floats, after: int) -> Floats:
    """The lattice point between two consecutive cracks' mid-points."""
    a, b = samples[after], samples[after + 1]
    return np.asarray(np.where(a == np.round(a), a, np.where(b == np.round(b), b, (a + b) / 2)))


def _cut(found: Borders, turns: dict[int, list[Turn]]) -> Borders:
    """The borders cut; `turns` are those of every border that has some, in order."""
    nodes = list(found.nodes)
    pieces: list[Border] = []
    pieces_of: list[list[int]] = []
    for k, border in enumerate(found.borders):
        own = _pieces(border, turns.get(k, []), nodes)
        pieces_of.append(list(range(len(pieces), len(pieces) + len(own))))
        pieces += own

    def walked(loop: Loop) -> Loop:
        return tuple((c, fwd) for a, fwd in loop for c in (pieces_of[a] if fwd else pieces_of[a][::-1]))

    loops = tuple(tuple(walked(loop) for loop in region) for region in found.loops)
    return with_nodes_in_order(replace(found, nodes=np.array(nodes), borders=tuple(pieces), loops=loops))


def _pieces(border: Border, turns: list[Turn], nodes: list[Floats]) -> list[Border]:
    """A border cut where it turns; new nodes are appended to `nodes`."""
    if not turns:
        return [border]
    samples, trust = border.samples, border.trust
    cuts = [turn.after for turn in turns]
    numbers = list(range(len(nodes), len(nodes) + len(turns)))
    nodes += [turn.place for turn in turns]
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
