"""Which of the Delaunay triangulations it is, where vertices on one circle leave several."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel, kernel
from gcvec.patches.segment_table import NO_SEGMENT, SegmentTable, segment_between
from gcvec.raster.triangle import double_area

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

ON_CIRCLE = 1e-12
"""Four vertices lie on a circle if the incircle determinant is at most this share of the sum of its terms'
sizes: samples come with the errors of floating-point arithmetic."""


def settle_ties(
    corners: Ints, neighbors: NDArray[np.uint32], patch: Ints, vertices: Floats, table: SegmentTable
) -> None:
    """Cut every polygon of boundary samples on one circle into the fan of its vertex with the lowest number.

    The triangles `(t, 3)` of a constrained Delaunay triangulation are changed in place; their `neighbors`
    `(t, 3)` lie across the edges from corner k to k + 1 and stay as they were, as does the patch `(t,)` of
    each. Corners are numbers of `vertices` `(v, 2)`, or negative. Interior vertices are jittered: none of
    them is on a circle with three others.
    """
    tied = np.zeros(corners.shape, np.bool_)
    if _find_ties(corners, neighbors, patch, vertices, table, tied):
        _cut_into_fans(corners, neighbors, vertices, tied)


@kernel
def _find_ties(corners, neighbors, patch, vertices, table, tied):
    """Mark the edges that could as well be others; whether there are any."""
    n, n_samples = len(corners), len(table.start) - 1
    found = False
    for t in range(n):
        u, v, w = corners[t, 0], corners[t, 1], corners[t, 2]
        if patch[t] < 0 or min(u, v, w) < 0 or max(u, v, w) >= n_samples:
            continue
        for k in range(3):
            other = np.int64(neighbors[t, k])
            if other <= t or other >= n or patch[other] != patch[t]:
                continue
            a, b, c = corners[t, k], corners[t, (k + 1) % 3], corners[t, (k + 2) % 3]
            across = 0
            while corners[other, across] == a or corners[other, across] == b:
                across += 1
            d = corners[other, across]
            if not 0 <= d < n_samples or not _on_circle(vertices[a], vertices[b], vertices[c], vertices[d]):
                continue
            if segment_between(table, a, b) == NO_SEGMENT:
                # The edge that is not at the corner across begins behind it.
                tied[t, k] = tied[other, (across + 1) % 3] = found = True
    return found


@bare_kernel
def _on_circle(a, b, c, d):
    """Whether the incircle determinant of the four is nothing but rounding."""
    ax, ay, bx, by, cx, cy = a[0] - d[0], a[1] - d[1], b[0] - d[0], b[1] - d[1], c[0] - d[0], c[1] - d[1]
    aa, bb, cc = ax * ax + ay * ay, bx * bx + by * by, cx * cx + cy * cy
    determinant = aa * (bx * cy - cx * by) + bb * (cx * ay - ax * cy) + cc * (ax * by - bx * ay)
    size = aa * (abs(bx * cy) + abs(cx * by)) + bb * (abs(cx * ay) + abs(ax * cy))
    size += cc * (abs(ax * by) + abs(bx * ay))
    return abs(determinant) <= ON_CIRCLE * size


@kernel
def _cut_into_fans(corners, neighbors, vertices, tied):
    n = len(corners)
    seen = np.zeros(n, np.bool_)
    polygon = np.empty(n, np.int64)
    following = np.full(len(vertices), -1, np.int64)
    for first in range(n):
        if seen[first] or not (tied[first, 0] or tied[first, 1] or tied[first, 2]):
            continue
        polygon[0], seen[first] = first, True
        size, i = 1, 0
        while i < size:
            t = polygon[i]
            i += 1
            for k in range(3):
                if not tied[t, k]:
                    following[corners[t, k]] = corners[t, (k + 1) % 3]
                elif not seen[neighbors[t, k]]:
                    seen[neighbors[t, k]] = True
                    polygon[size] = neighbors[t, k]
                    size += 1
        _cut(corners, polygon[:size], vertices, following)


@kernel
def _cut(corners, polygon, vertices, following):
    """Cut a polygon, given by its triangles and the vertex `following` each of its own; forget the latter."""
    fan = np.empty((len(polygon), 3), np.int64)
    lowest = corners[polygon[0], 0]
    for t in polygon:
        lowest = min(lowest, min(corners[t]))
    v, n = following[lowest], 0
    while v >= 0 and following[v] >= 0 and following[v] != lowest and n < len(polygon):
        w = following[v]
        fan[n] = lowest, v, w
        if double_area(vertices, lowest, v, w) <= 0:
            break
        v, n = w, n + 1
    whole = n == len(polygon) and following[v] == lowest
    for i, t in enumerate(polygon):
        for k in range(3):
            following[corners[t, k]] = -1
        if whole:  # else rounding has made another shape of it
            corners[t] = fan[i]
