"""All borders inside a picture as one array of samples, so that every step works on all of them at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Border, Borders, between_nodes

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]


@dataclass(frozen=True)
class Chains:
    """Borders off the frame, laid end to end; a closed one without its repeated last sample.

    `which` `(b,)` are their numbers, `closed` `(b,)`, `nodes` `(b, 2)` where they start and end (-1: closed)
    and `offsets` `(b + 1,)` where each begins in an array of samples.
    """

    which: Ints
    closed: Flags
    nodes: Ints
    offsets: Ints

    @cached_property
    def of_sample(self) -> Ints:
        """The chain `(n,)` of every sample."""
        return np.repeat(np.arange(len(self.which)), np.diff(self.offsets))

    @cached_property
    def first(self) -> Ints:
        """The first sample `(n,)` of every sample's chain."""
        return self.offsets[self.of_sample]

    @cached_property
    def size(self) -> Ints:
        """How many samples `(n,)` every sample's chain has."""
        return np.asarray(np.diff(self.offsets)[self.of_sample])

    @cached_property
    def at_node(self) -> Flags:
        """Which samples `(n,)` are nodes."""
        ends = np.zeros(self.offsets[-1], bool)
        ends[self.offsets[:-1][~self.closed]] = True
        ends[self.offsets[1:][~self.closed] - 1] = True
        return ends

    @cached_property
    def _known(self) -> dict[int, tuple[Ints, Flags]]:
        return {}

    def along(self, steps: int) -> tuple[Ints, Flags]:
        """For every sample the one so many steps ahead, `(n,)`, and whether there is one.

        Closed chains go round; on open ones it is the last before the end.
        """
        if steps not in self._known:
            self._known[steps] = self._along(steps)
        return self._known[steps]

    def _along(self, steps: int) -> tuple[Ints, Flags]:
        first, size = self.first, self.size
        place = np.arange(self.offsets[-1]) - first + steps
        round_ = self.closed[self.of_sample]
        there = (round_ & (2 * abs(steps) < size)) | (~round_ & (place >= 0) & (place < size))
        return first + np.where(round_, place % size, np.clip(place, 0, size - 1)), there

    def joined(self, rows: list[Floats]) -> Floats:
        """One array from rows of values at the borders' samples."""
        own = (rows[k][:-1] if closed else rows[k] for k, closed in zip(self.which, self.closed, strict=True))
        return np.concatenate([*own, rows[0][:0]])

    def with_ends(self, points: Floats, nodes: Floats) -> Floats:
        """The points `(n, 2)` with those at nodes where `nodes` `(k, 2)` are."""
        placed = points.copy()
        open_ = ~self.closed
        placed[self.offsets[:-1][open_]] = nodes[self.nodes[open_, 0]]
        placed[self.offsets[1:][open_] - 1] = nodes[self.nodes[open_, 1]]
        return placed

    def put_back(self, found: Borders, nodes: Floats, points: Floats, trust: Floats) -> Borders:
        """The borders through `points` `(n, 2)` of this `trust` `(n,)`, between `nodes`."""
        moved = list(found.borders)
        for b, k in enumerate(self.which):
            own = slice(self.offsets[b], self.offsets[b + 1])
            samples, known = points[own], trust[own]
            if self.closed[b]:
                samples, known = np.vstack([samples, samples[:1]]), np.append(known, known[0])
            moved[k] = moved[k].through(samples, known)
        return replace(found, nodes=nodes, borders=tuple(between_nodes(b, nodes) for b in moved))


def chains_of(found: Borders) -> Chains:
    which = [k for k, border in enumerate(found.borders) if not border.on_frame]
    inside = [found.borders[k] for k in which]
    sizes = [_size(border) for border in inside]
    return Chains(
        np.array(which, np.int64),
        np.array([border.closed for border in inside], bool),
        np.array([(border.start, border.end) for border in inside], np.int64).reshape(-1, 2),
        np.cumsum([0, *sizes]),
    )


def _size(border: Border) -> int:
    return len(border.samples) - border.closed
