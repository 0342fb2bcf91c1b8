"""Which of many line segments meet anywhere but in a common end. Exact.

Segments are sorted into square cells; within a cell every pair is looked at. Where rounding could decide, a
pair is decided in rational numbers.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]

CELL = 8.0
"""Side of the cells, pixels."""

ROUNDING = 3.4e-16
"""Bound of the relative error of an orientation (Shewchuk 1997)."""


def crossing_segments(segments: Floats, asked: Flags) -> Flags:
    """Which segments `(n, 2, 2)` meet one that is `asked` `(n,)`, or, themselves asked, meet any, in a point
    that is not an end of both.

    Those without length count as crossing, though nothing crosses them.
    """
    segments = np.ascontiguousarray(segments)
    cells, starts = _cells(segments)
    bad, unsure = _crossing(segments, asked, cells, starts)
    for a, b in {(int(a), int(b)) for a, b in unsure}:
        if not (bad[a] and bad[b]) and _meet(segments[a], segments[b]):
            bad[[a, b]] = True
    return np.asarray(bad)


def _meet(one: Floats, other: Floats) -> bool:
    """Whether two segments have a point in common other than an end of both, in rational numbers."""
    a, b, c, d = ((Fraction(float(x)), Fraction(float(y))) for x, y in (*one, *other))
    if {a, b} & {c, d}:
        # They run the same way from their common end, as far as rounding can tell.
        return _side(a, b, c) == _side(a, b, d) == 0
    sides = [_side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b)]
    if any(sides):
        return sides[0] * sides[1] <= 0 and sides[2] * sides[3] <= 0
    return all(max(min(a[k], b[k]), min(c[k], d[k])) <= min(max(a[k], b[k]), max(c[k], d[k])) for k in (0, 1))


_Point = tuple[Fraction, Fraction]


def _side(a: _Point, b: _Point, p: _Point) -> int:
    """On which side of the line from a to b the point p lies: -1, 0 or 1."""
    turn = (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
    return (turn > 0) - (turn < 0)


def _cells(segments: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The segments in each cell, one cell after another, and where each cell's begin."""
    x, y = segments[..., 0], segments[..., 1]
    low = np.array([x.min(initial=0.0), y.min(initial=0.0)])
    columns = int((x.max(initial=0.0) - low[0]) // CELL) + 1
    rows = int((y.max(initial=0.0) - low[1]) // CELL) + 1
    cell, segment = _cells_met(segments, low, columns, rows)
    order = np.argsort(cell, kind="stable")
    starts = np.searchsorted(cell[order], np.arange(columns * rows + 1))
    return segment[order], starts


@kernel
def _cells_met(segments, low, columns, rows):
    """Pairs of cell and segment: in every row of cells, those that the segment's part there spans, with a
    margin."""
    capacity = 4 * len(segments) + 1024
    cell, segment = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
    n = 0
    for s in range(len(segments)):
        x0, y0 = (segments[s, 0] - low) / CELL
        x1, y1 = (segments[s, 1] - low) / CELL
        if y0 > y1:
            x0, y0, x1, y1 = x1, y1, x0, y0
        for row in range(max(int(y0 - 1e-6), 0), min(int(y1 + 1e-6), rows - 1) + 1):
            a, b = x0, x1
            if y1 - y0 > 1e-9:
                a = x0 + min(max((row - y0) / (y1 - y0), 0.0), 1.0) * (x1 - x0)
                b = x0 + min(max((row + 1 - y0) / (y1 - y0), 0.0), 1.0) * (x1 - x0)
            first = max(int(min(a, b) - 1e-6), 0)
            last = min(int(max(a, b) + 1e-6), columns - 1)
            if n + last - first + 1 > capacity:
                capacity = 2 * capacity + last - first
                more_cell, more_segment = np.empty(capacity, np.int64), np.empty(capacity, np.int64)
                more_cell[:n], more_segment[:n] = cell[:n], segment[:n]
                cell, segment = more_cell, more_segment
            for column in range(first, last + 1):
                cell[n], segment[n] = row * columns + column, s
                n += 1
    return cell[:n], segment[:n]


@kernel
def _orientation(a, b, p):
    """Sign of the side of p seen from a to b; 2 where rounding decides."""
    left = (b[0] - a[0]) * (p[1] - a[1])
    right = (b[1] - a[1]) * (p[0] - a[0])
    if abs(left - right) <= ROUNDING * (abs(left) + abs(right)):
        return 2
    return 1 if left > right else -1


@kernel
def _same(a, b):
    return a[0] == b[0] and a[1] == b[1]


@kernel
def _pair(one, other):
    """Whether two segments meet where they must not: 0, 1, or 2 if that is left to exact arithmetic."""
    a, b, c, d = one[0], one[1], other[0], other[1]
    for k in range(2):
        if max(a[k], b[k]) < min(c[k], d[k]) or max(c[k], d[k]) < min(a[k], b[k]):
            return 0
    shared = int(_same(a, c)) + int(_same(a, d)) + int(_same(b, c)) + int(_same(b, d))
    if shared > 1:
        return 1
    if shared == 1:
        # From the common end they may still run the same way.
        if _same(b, c) or _same(b, d):
            a, b = b, a
        if _same(a, d):
            c, d = d, c
        ahead = (b[0] - a[0]) * (d[0] - a[0]) + (b[1] - a[1]) * (d[1] - a[1]) > 0
        return 2 if ahead and _orientation(a, b, d) == 2 else 0
    first, second = _orientation(a, b, c), _orientation(a, b, d)
    if first == second and first != 2:
        return 0
    third, fourth = _orientation(c, d, a), _orientation(c, d, b)
    if third == fourth and third != 2:
        return 0
    return 2 if 2 in (first, second, third, fourth) else 1


@kernel
def _crossing(segments, asked, cells, starts):
    """Which segments cross, `(n,)`, and the pairs `(k, 2)` left to exact arithmetic."""
    empty = np.zeros(len(segments), np.bool_)
    for s in range(len(segments)):
        empty[s] = _same(segments[s, 0], segments[s, 1])
    bad = empty.copy()
    unsure = []
    for cell in range(len(starts) - 1):
        for i in range(starts[cell], starts[cell + 1]):
            for j in range(starts[cell], i):
                a, b = cells[i], cells[j]
                if not (asked[a] or asked[b]) or (bad[a] and bad[b]) or empty[a] or empty[b]:
                    continue
                met = _pair(segments[a], segments[b])
                if met == 1:
                    bad[a] = bad[b] = True
                elif met == 2:
                    unsure.append((a, b))
    pairs = np.empty((len(unsure), 2), np.int64)
    for k in range(len(unsure)):
        pairs[k, 0], pairs[k, 1] = unsure[k]
    return bad, pairs
