"""Polygons onto pixels, exactly: a pixel belongs to a polygon when its centre does."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel


class Fill(NamedTuple):
    """What one ring painted: the number of pixels, and whether it winds around some of them oddly."""

    pixels: int
    crosses_itself: bool


def fill_ring(canvas: NDArray[np.int32], ring: NDArray[np.float64], value: int) -> Fill:
    """Write `value` into the pixels of `canvas (h, w)` whose centres lie inside `ring (n, 2)`, in place.

    Inside means a winding number other than 0, as drawing programs show a polygon; a self-intersecting ring
    needs no repair for that. A centre exactly on an edge belongs to the polygon on its right, on a horizontal
    edge to the one below, so polygons that share an edge share no pixel and leave none out. The coordinates
    must be finite; the last vertex joins the first.
    """
    height = canvas.shape[0]
    start, end = ring, np.roll(ring, -1, axis=0)
    downward = end[:, 1] > start[:, 1]
    top = np.where(downward[:, None], start, end)
    bottom = np.where(downward[:, None], end, start)
    first = np.clip(np.ceil(top[:, 1] - 0.5), 0, height).astype(np.int64)
    stop = np.clip(np.ceil(bottom[:, 1] - 0.5), 0, height).astype(np.int64)
    crossed = np.flatnonzero(first < stop)
    order = crossed[np.argsort(first[crossed], kind="stable")]
    if not len(order):
        return Fill(0, False)
    direction = np.where(downward, 1, -1).astype(np.int64)
    painted, lowest, highest = _fill_rows(
        canvas, np.int32(value), top[order], bottom[order], first[order], stop[order], direction[order]
    )
    return Fill(int(painted), bool(highest - lowest > 1))


@kernel
def _is_left_of_centre(
    top: NDArray[np.float64], bottom: NDArray[np.float64], edge: int, row: int, column: int
) -> bool:
    """Whether the edge passes through the pixel's centre or left of it; exact for coordinates of few bits."""
    dx, dy = bottom[edge, 0] - top[edge, 0], bottom[edge, 1] - top[edge, 1]
    return bool((column + 0.5 - top[edge, 0]) * dy >= (row + 0.5 - top[edge, 1]) * dx)


@kernel
def _first_column(
    top: NDArray[np.float64], bottom: NDArray[np.float64], edge: int, row: int, width: int
) -> int:
    """The first column whose centre is not left of the edge, 0 to `width`."""
    slope = (bottom[edge, 0] - top[edge, 0]) / (bottom[edge, 1] - top[edge, 1])
    crossing = top[edge, 0] + (row + 0.5 - top[edge, 1]) * slope
    column = int(min(max(np.ceil(crossing - 0.5), 0.0), float(width)))
    while column > 0 and _is_left_of_centre(top, bottom, edge, row, column - 1):
        column -= 1
    while column < width and not _is_left_of_centre(top, bottom, edge, row, column):
        column += 1
    return column


@kernel
def _fill_rows(
    canvas: NDArray[np.int32],
    value: np.int32,
    top: NDArray[np.float64],
    bottom: NDArray[np.float64],
    first: NDArray[np.int64],
    stop: NDArray[np.int64],
    direction: NDArray[np.int64],
) -> tuple[int, int, int]:
    """Scanlines over edges sorted by `first` row; returns pixels painted, lowest and highest winding."""
    width = canvas.shape[1]
    turns = np.zeros(width + 1, dtype=np.int64)
    active = np.empty(len(first), dtype=np.int64)
    count = following = painted = lowest = highest = 0
    for row in range(first[0], stop.max()):
        while following < len(first) and first[following] <= row:
            active[count] = following
            count += 1
            following += 1
        left, right, kept = width, 0, 0
        for i in range(count):
            edge = active[i]
            if stop[edge] <= row:
                continue
            active[kept] = edge
            kept += 1
            column = _first_column(top, bottom, edge, row, width)
            turns[column] += direction[edge]
            left, right = min(left, column), max(right, column)
        count = kept
        winding = 0
        for column in range(left, right):
            winding += turns[column]
            turns[column] = 0
            if winding != 0:
                canvas[row, column] = value
                painted += 1
                lowest, highest = min(lowest, winding), max(highest, winding)
        turns[right] = 0
    return painted, lowest, highest
