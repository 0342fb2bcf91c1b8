"""Triangles along curves, cut into fans."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel, kernel
from gcvec.patches.segment_table import NO_SEGMENT, SegmentTable, segment_between

Ints = NDArray[np.int64]


def fans(triangles: Ints, table: SegmentTable, first: Ints, count: Ints) -> tuple[Ints, Ints]:
    """What takes the place of triangles `(t, 3)` with edges that are segments of the table with vertices
    between their ends: `count` `(s,)` for each segment, numbered from `first` `(s,)` on along it.

    Returns triangles `(f, 3)`, and which one of the old ones `(f,)` each is in the place of. A triangle with
    such an edge becomes a fan about the opposite corner; what is left of its other edges belongs to the first
    and the last of the fan, and is fanned there.
    """
    found: tuple[Ints, Ints] = _fans(triangles, table, first, count)
    return found


@kernel
def _fans(triangles, table, first, count):
    size, n = np.empty(len(triangles), np.int64), 0
    for t in range(len(triangles)):
        size[t] = _fan_size(triangles, t, table, count)
        n += size[t]
    fan, owner = np.empty((n, 3), np.int64), np.empty(n, np.int64)
    n = 0
    for t in range(len(triangles)):
        if size[t] > 0:
            owner[n : n + size[t]] = t
            n = _fill(triangles, t, table, first, count, fan, n)
    return fan, owner


@bare_kernel
def _fan_size(triangles, t, table, count):
    """How many triangles take the place of one; 0: it stays."""
    added = 0
    for k in range(3):
        added += _between(triangles[t, k], triangles[t, (k + 1) % 3], table, count)
    return added + 1 if added else 0


@bare_kernel
def _between(a, b, table, count):
    """How many vertices there are between the ends of an edge."""
    segment = segment_between(table, a, b)
    return 0 if segment == NO_SEGMENT else count[segment]


@bare_kernel
def _step(a, b, step, table, first, count):
    """The vertex so many steps from a along the edge to b."""
    segment = segment_between(table, a, b)
    if step == 0:
        return a
    if step == count[segment] + 1:
        return b
    return first[segment] + (step - 1 if table.ends[segment, 0] == a else count[segment] - step)


@bare_kernel
def _fill(triangles, t, table, first, count, fan, n):
    k = 0
    while _between(triangles[t, k], triangles[t, (k + 1) % 3], table, count) == 0:
        k += 1
    a, b, apex = triangles[t, k], triangles[t, (k + 1) % 3], triangles[t, (k + 2) % 3]
    last = _between(a, b, table, count)
    for step in range(last + 1):
        start = _step(a, b, step, table, first, count)
        end = _step(a, b, step + 1, table, first, count)
        if step == 0 and _between(apex, a, table, count) > 0:
            n = _fan(apex, a, end, table, first, count, fan, n)
        elif step == last and _between(b, apex, table, count) > 0:
            n = _fan(b, apex, start, table, first, count, fan, n)
        else:
            fan[n, 0], fan[n, 1], fan[n, 2] = start, end, apex
            n += 1
    return n


@bare_kernel
def _fan(a, b, apex, table, first, count, fan, n):
    """The fan about `apex` over the edge from a to b."""
    for step in range(_between(a, b, table, count) + 1):
        fan[n, 0] = _step(a, b, step, table, first, count)
        fan[n, 1] = _step(a, b, step + 1, table, first, count)
        fan[n, 2] = apex
        n += 1
    return n
