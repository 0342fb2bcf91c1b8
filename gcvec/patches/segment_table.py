"""Looking up which edges of triangles are segments of the boundary."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel, kernel

Ints = NDArray[np.int64]

NO_SEGMENT = -1
"""Of two vertices that no segment joins."""


class SegmentTable(NamedTuple):
    """Segments by the smaller one of their ends.

    ends    (s, 2) int64, vertices
    start   (v + 1,) int64, where each vertex's own begin in `number`
    number  (s,) int64, segments
    """

    ends: Ints
    start: Ints
    number: Ints


def segment_table(segments: Ints, n_vertices: int) -> SegmentTable:
    """The table of segments `(s, 2)` between the first `n_vertices` vertices."""
    segments = np.ascontiguousarray(segments)
    start, number = np.zeros(n_vertices + 1, np.int64), np.empty(len(segments), np.int64)
    _list(segments, start, number)
    return SegmentTable(segments, start, number)


@kernel
def _list(segments, start, number):
    n_vertices = len(start) - 1
    for i in range(len(segments)):
        start[min(segments[i, 0], segments[i, 1]) + 1] += 1
    for v in range(n_vertices):
        start[v + 1] += start[v]
    listed = start[:-1].copy()
    for i in range(len(segments)):
        low = min(segments[i, 0], segments[i, 1])
        number[listed[low]] = i
        listed[low] += 1


@bare_kernel
def segment_between(table, a, b):
    """The segment that joins two vertices, in either direction; -1: none."""
    low, high = min(a, b), max(a, b)
    if low < 0 or high >= len(table.start) - 1:
        return NO_SEGMENT
    for i in range(table.start[low], table.start[low + 1]):
        segment = table.number[i]
        if max(table.ends[segment, 0], table.ends[segment, 1]) == high:
            return segment
    return NO_SEGMENT
