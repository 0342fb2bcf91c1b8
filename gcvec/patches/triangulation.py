"""Constrained Delaunay triangulations, and which patches their triangles belong to."""

from __future__ import annotations

from typing import Any

import numpy as np
import pythoncdt
from numpy.typing import NDArray

from gcvec.kernels import kernel
from gcvec.patches.segment_table import NO_SEGMENT, segment_between, segment_table
from gcvec.patches.ties import settle_ties

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

AROUND = 3
"""Vertices that the library begins with: the corners of a triangle around everything."""

NO_PATCH = -2
"""Of a triangle that no patch has reached yet."""


def constrained_delaunay(vertices: Floats, segments: Ints) -> tuple[Ints, Ints]:
    """Triangles `(t, 3)` and their neighbours `(t, 3)` (-1: none) inside the outermost constraint segments.

    Neighbour k lies across the edge from corner k to corner k + 1.
    """
    cdt = _triangulation(vertices, segments)
    cdt.erase_outer_triangles()
    corners, neighbors = (array.astype(np.int64) for array in _arrays(cdt))
    neighbors[neighbors == pythoncdt.NO_NEIGHBOR] = -1
    return corners, neighbors


def patch_triangulation(vertices: Floats, segments: Ints, sides: Ints, height: int) -> tuple[Ints, Ints]:
    """Triangles `(t, 3)` that belong to patches, and those patches `(t,)`, in a picture of that height.

    `sides` `(s, 2)` are the patches to the right and to the left of each of the `segments` `(s, 2)`, for
    those who walk along it with y downwards; negative where there is none. Triangles come row by row, so that
    what is near in the picture is near in memory.
    """
    numbers, neighbors = _arrays(_triangulation(vertices, segments))
    corners = numbers.astype(np.int64) - AROUND
    table = segment_table(segments, int(segments.max()) + 1)
    patch = np.full(len(corners), NO_PATCH)
    _spread(corners, neighbors, table, np.ascontiguousarray(sides), patch)
    settle_ties(corners, neighbors, patch, vertices, table)
    found: tuple[Ints, Ints] = _by_rows(corners, patch, vertices, height)
    return found


def _triangulation(vertices: Floats, segments: Ints) -> Any:
    cdt: Any = pythoncdt.Triangulation(  # its stubs know sequences only
        pythoncdt.VertexInsertionOrder.AUTO, pythoncdt.IntersectingConstraintEdges.NOT_ALLOWED, 0.0
    )
    cdt.insert_vertices(np.ascontiguousarray(vertices, np.float64))
    cdt.insert_edges(np.ascontiguousarray(segments, np.uint32))
    return cdt


def _arrays(cdt: Any) -> tuple[NDArray[np.uint32], NDArray[np.uint32]]:
    """Corners and neighbours `(t, 3)` of the library's triangles."""
    triangles = cdt.triangles_array()
    return np.ascontiguousarray(triangles["vertices"]), np.ascontiguousarray(triangles["neighbors"])


@kernel
def _spread(corners, neighbors, table, sides, patch):
    """Patch of every triangle: known at the segments, spread from there."""
    n = len(corners)
    sealed = np.zeros((n, 3), np.bool_)
    stack, top = np.empty(n, np.int64), 0
    for t in range(n):
        for k in range(3):
            a, b = corners[t, k], corners[t, (k + 1) % 3]
            segment = segment_between(table, a, b)
            if segment == NO_SEGMENT:
                continue
            sealed[t, k] = True
            if patch[t] == NO_PATCH:
                patch[t] = sides[segment, 0 if table.ends[segment, 0] == a else 1]
                stack[top] = t
                top += 1
    while top > 0:
        top -= 1
        t = stack[top]
        for k in range(3):
            other = np.int64(neighbors[t, k])
            if not sealed[t, k] and other < n and patch[other] == NO_PATCH:
                patch[other] = patch[t]
                stack[top] = other
                top += 1


@kernel
def _by_rows(corners, patch, vertices, height):
    """The triangles of patches, less the library's own vertices, sorted by three times their mean height."""
    rows = 3 * height
    row, start = np.full(len(corners), -1, np.int64), np.zeros(rows + 2, np.int64)
    for t in range(len(corners)):
        if patch[t] < 0 or min(corners[t, 0], corners[t, 1], corners[t, 2]) < 0:
            continue
        total = 0.0
        for k in range(3):
            total += vertices[corners[t, k], 1]
        row[t] = min(max(int(total), 0), rows)
        start[row[t] + 1] += 1
    for r in range(rows + 1):
        start[r + 1] += start[r]
    n = start[rows + 1]
    sorted_corners, sorted_patch = np.empty((n, 3), np.int64), np.empty(n, np.int64)
    for t in range(len(corners)):
        if row[t] < 0:
            continue
        at = start[row[t]]
        start[row[t]] += 1
        sorted_patch[at] = patch[t]
        for k in range(3):
            sorted_corners[at, k] = corners[t, k]
    return sorted_corners, sorted_patch
