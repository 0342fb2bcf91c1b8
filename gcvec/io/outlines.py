"""Label map -> the outer outline of every region, and how deep it lies inside others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

_WEST = 2
_START = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
"""Where the crack of each direction - east, south, west, north - starts, seen from the pixel at its right:
they are the pixel's four sides, clockwise."""


class Outline(NamedTuple):
    """The outer border of a region along pixel edges.

    `ring` is `(n, 2) int64`: the pixel corners where it turns, clockwise on the screen. What the region
    surrounds lies inside `ring` too; `depth` is the number of regions that surround the region itself.
    """

    ring: NDArray[np.int64]
    depth: int


def outlines(labels: NDArray[np.int32]) -> list[Outline]:
    """One outline a region of `labels (h, w)`, whose regions are 4-connected and numbered in raster order.

    Filled in that order, or by depth, the outlines give the label map again: what surrounds a region has its
    first pixel above the region's own, so it comes before it.
    """
    cracks = _Cracks(labels)
    found: list[Outline] = []
    for first in np.unique(labels, return_index=True)[1].tolist():
        y, x = divmod(first, labels.shape[1])
        depth = 0
        if y > 0:
            surrounded = not cracks.is_outer_below(x, y - 1)
            depth = found[labels[y - 1, x]].depth + surrounded
        found.append(Outline(cracks.outer_ring(x, y), depth))
    return found


class _Cracks:
    """The pixel edges between different regions, once a side, directed to have the pixel at the right."""

    def __init__(self, labels: NDArray[np.int32]) -> None:
        padded = np.pad(labels, 1, constant_values=-1)
        self._width = padded.shape[1]
        self._size = padded.size
        flat = padded.ravel()
        inside = np.flatnonzero(flat >= 0)
        steps = (1, self._width, -1, -self._width)
        ids, following = [], []
        for direction in range(4):
            ahead, left = steps[direction], steps[direction - 1]
            pixel = inside[flat[inside] != flat[inside + left]]
            blocked = flat[pixel + ahead] != flat[pixel]
            straight = flat[pixel + ahead + left] != flat[pixel]
            ids.append(direction * self._size + pixel)
            following.append(
                np.where(
                    blocked,
                    (direction + 1) % 4 * self._size + pixel,
                    np.where(
                        straight,
                        direction * self._size + pixel + ahead,
                        (direction + 3) % 4 * self._size + pixel + ahead + left,
                    ),
                )
            )
        self._ids = np.concatenate(ids)
        self._next = np.searchsorted(self._ids, np.concatenate(following)).tolist()
        self._outer = np.zeros(len(self._ids), dtype=np.bool_)

    def outer_ring(self, x: int, y: int) -> NDArray[np.int64]:
        """The ring that starts at the top side of a region's first pixel."""
        start = crack = self._index(0, x, y)
        walk = [start]
        while (crack := self._next[crack]) != start:
            walk.append(crack)
        self._outer[walk] = True
        direction, pixel = np.divmod(self._ids[walk], self._size)
        turns = direction != np.roll(direction, 1)
        row, column = np.divmod(pixel[turns], self._width)
        corners: NDArray[np.int64] = np.column_stack([column - 1, row - 1]) + _START[direction[turns]]
        return corners

    def is_outer_below(self, x: int, y: int) -> bool:
        """Whether the lower side of the pixel belongs to a ring already walked."""
        return bool(self._outer[self._index(_WEST, x, y)])

    def _index(self, direction: int, x: int, y: int) -> int:
        crack = direction * self._size + (y + 1) * self._width + x + 1
        return int(np.searchsorted(self._ids, crack))
