"""Run-length encoded masks: CVAT's and COCO's. Runs alternate and start with background in both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Counts = NDArray[np.int64]


def row_major_mask(counts: Counts, width: int, height: int) -> NDArray[np.bool_]:
    """CVAT: the runs of a box, row by row. `counts` must sum to `width * height`; returns `(h, w) bool`."""
    foreground = np.arange(len(counts)) % 2 == 1
    return np.repeat(foreground, counts).reshape(height, width)


def runs_of(mask: NDArray[np.bool_]) -> list[int]:
    """The runs of a flat mask `(n,)`; the first is of background, 0 long where there is none."""
    changes = np.flatnonzero(np.diff(mask)) + 1
    start = [0, 0] if mask[0] else [0]
    lengths: list[int] = np.diff(np.concatenate([start, changes, [len(mask)]])).tolist()
    return lengths


class ColumnRuns:
    """COCO: the runs of a whole picture, column by column, reduced to the box that holds the foreground.

    `box` is `(left, top, width, height)`, known before any pixel is written; width 0 means an empty mask.
    """

    def __init__(self, counts: Counts, height: int) -> None:
        ends = np.cumsum(counts)
        starts, ends = (ends - counts)[1::2], ends[1::2]
        starts, ends = starts[ends > starts], ends[ends > starts]
        column, top = np.divmod(starts, height)
        last_column, bottom = np.divmod(ends - 1, height)
        self._runs = column, top, last_column, bottom + 1
        self._height = height
        self.box = self._bounding_box()

    def _bounding_box(self) -> tuple[int, int, int, int]:
        column, top, last_column, bottom = self._runs
        if not len(column):
            return 0, 0, 0, 0
        left, right = int(column.min()), int(last_column.max()) + 1
        if (last_column > column).any():
            return left, 0, right - left, self._height
        return left, int(top.min()), right - left, int(bottom.max() - top.min())

    def mask(self) -> NDArray[np.bool_]:
        """The mask inside `box`, `(h, w) bool`."""
        left, y, width, height = self.box
        column, top, last_column, bottom = self._runs
        flat = np.zeros(width * height + 1, dtype=np.int8)
        first = (column - left) * height + (top - y)
        stop = (last_column - left) * height + (bottom - y)
        np.add.at(flat, first, 1)
        np.add.at(flat, stop, -1)
        return np.cumsum(flat[:-1], dtype=np.int8).astype(np.bool_).reshape(width, height).T


def decode_compressed_counts(text: str) -> list[int]:
    """COCO's compressed form: digits of 5 bits and a continuation bit, the lowest first, each a character
    from "0" on. Runs from the fourth on are stored as differences to the one before the last.

    Raises `ValueError` when the text ends within a number or holds a foreign character.
    """
    counts: list[int] = []
    value = shift = 0
    for character in text:
        digit = ord(character) - 48
        if not 0 <= digit < 64 or shift > 60:
            raise ValueError("not a compressed run-length code")
        value |= (digit & 31) << shift
        shift += 5
        if digit & 32:
            continue
        if digit & 16:
            value -= 1 << shift
        counts.append(value + (counts[-2] if len(counts) > 2 else 0))
        value = shift = 0
    if shift:
        raise ValueError("the run-length code ends within a number")
    return counts
