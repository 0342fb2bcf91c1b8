"""Put a vertex into a Delaunay triangulation, or take one out.

Insertion is Bowyer's and Watson's (1981): the triangles whose circumcircles hold the new vertex make way for
a fan about it. Removal fills the hole ear by ear, each with an empty circumcircle (Devillers 2002). Frozen
edges are never crossed, so the triangulation stays a constrained one, and a change that would fold a triangle
over, in the domain or under S, is not made.
"""

from __future__ import annotations

from gcvec.greedy.strip import (
    ENTRIES,
    EXHAUSTED,
    MOST_CORNERS,
    NOBODY,
    SPARE,
    STAMP,
    TRIANGLES,
    corner_of,
    cover,
    most_entries,
    next_around,
)
from gcvec.kernels import bare_kernel
from gcvec.raster.triangle import double_area

LEAST_AREA = 1e-9
"""Twice the area of a triangle, pixels squared, below which it counts as folded."""

MOST_STEPS = 500
"""Triangles that are looked through for the one that holds a new vertex."""

FROM, TO, BEYOND, NUMBER = range(4)
"""Columns of the scratch list of a hole's edges: their ends, the triangle outside, the new one inside."""


@bare_kernel
def in_circle(points, a, b, c, q):
    """Whether q lies inside the circumcircle of the triangle a, b, c of positive area."""
    ax, ay = points[a, 0] - points[q, 0], points[a, 1] - points[q, 1]
    bx, by = points[b, 0] - points[q, 0], points[b, 1] - points[q, 1]
    cx, cy = points[c, 0] - points[q, 0], points[c, 1] - points[q, 1]
    determinant = (
        (ax * ax + ay * ay) * (bx * cy - by * cx)
        - (bx * bx + by * by) * (ax * cy - ay * cx)
        + (cx * cx + cy * cy) * (ax * by - ay * bx)
    )
    return determinant > 0


@bare_kernel
def _note(corners, i, start, end, beyond):
    corners[i, FROM], corners[i, TO], corners[i, BEYOND] = start, end, beyond


@bare_kernel
def _holder(triangles, neighbors, domain, vertex, start):
    """The triangle that holds a vertex, found by walking towards it; -1 where a frozen edge is in the way."""
    t = start
    for _ in range(MOST_STEPS):
        moved = False
        for k in range(3):
            if double_area(domain, triangles[t, k], triangles[t, (k + 1) % 3], vertex) < 0:
                t = neighbors[t, k]
                moved = True
                break
        if not moved or t == NOBODY:
            return t
    return NOBODY


@bare_kernel
def insert(strip, vertex, start):
    """Make a vertex whose places are known part of the mesh.

    Triangle `start` is near. The triangles about the vertex are `strip.holes[:n]` afterwards, n is returned;
    0 when it cannot be done.
    """
    t = _holder(strip.triangles, strip.neighbors, strip.domain, vertex, start)
    if t == NOBODY:
        return 0
    strip.counts[STAMP] += 1
    stamp, holes = strip.counts[STAMP], strip.holes
    holes[0] = t
    strip.mark[t] = stamp
    n_holes, n_edges, n_entries, i = 1, 0, 0, 0
    while i < n_holes:
        t = holes[i]
        for k in range(3):
            beyond = strip.neighbors[t, k]
            if beyond != NOBODY and strip.mark[beyond] == stamp:
                continue
            if beyond != NOBODY and n_holes < MOST_CORNERS - 2:
                a, b, c = strip.triangles[beyond, 0], strip.triangles[beyond, 1], strip.triangles[beyond, 2]
                if in_circle(strip.domain, a, b, c, vertex):
                    strip.mark[beyond] = stamp
                    holes[n_holes] = beyond
                    n_holes += 1
        i += 1
    for i in range(n_holes):
        t = holes[i]
        for k in range(3):
            beyond = strip.neighbors[t, k]
            if beyond == NOBODY or strip.mark[beyond] != stamp:
                a, b = strip.triangles[t, k], strip.triangles[t, (k + 1) % 3]
                if (
                    double_area(strip.domain, a, b, vertex) < LEAST_AREA
                    or double_area(strip.image, a, b, vertex) < LEAST_AREA
                    or n_edges == MOST_CORNERS
                ):
                    return 0
                n_entries += most_entries(strip, a, b, vertex)
                _note(strip.corners, n_edges, a, b, beyond)
                n_edges += 1
    if n_edges != n_holes + 2:
        return 0
    if strip.counts[ENTRIES] + n_entries > len(strip.pixel):
        strip.counts[EXHAUSTED] = 1
        return 0
    patch, corners = strip.patch[holes[0]], strip.corners
    for i in range(n_holes):
        _paint(strip, holes[i], 1.0)
    for i in range(n_edges):
        if i >= n_holes:
            holes[i] = _new_triangle(strip)
        corners[i, NUMBER] = holes[i]
    for i in range(n_edges):
        a, b, beyond, t = corners[i, FROM], corners[i, TO], corners[i, BEYOND], corners[i, NUMBER]
        strip.triangles[t, 0], strip.triangles[t, 1], strip.triangles[t, 2] = a, b, vertex
        strip.patch[t] = patch
        strip.at_vertex[a] = t
        _face(strip.triangles, strip.neighbors, t, 0, beyond, b)
        for j in range(n_edges):
            if corners[j, FROM] == b:
                strip.neighbors[t, 1] = corners[j, NUMBER]
            if corners[j, TO] == a:
                strip.neighbors[t, 2] = corners[j, NUMBER]
    strip.at_vertex[vertex] = holes[0]
    _show(strip, n_edges)
    return n_edges


@bare_kernel
def remove(strip, vertex):
    """Take a vertex that is whole out of the mesh.

    The triangles that fill its place are `strip.holes[:n]` afterwards, n is returned; 0 when it cannot be
    done.
    """
    n, t, holes = 0, strip.at_vertex[vertex], strip.holes
    while n == 0 or t != strip.at_vertex[vertex]:
        if n == MOST_CORNERS:
            return 0
        k = corner_of(strip.triangles, t, vertex)
        a, b = strip.triangles[t, (k + 1) % 3], strip.triangles[t, (k + 2) % 3]
        _note(strip.corners, n, a, b, strip.neighbors[t, (k + 1) % 3])
        holes[n] = t
        n += 1
        t = next_around(strip.triangles, strip.neighbors, t, vertex)
    n_ears = _cut_ears(strip, n)
    if n_ears == 0:
        return 0
    patch = strip.patch[holes[0]]
    for i in range(n):
        _paint(strip, holes[i], 1.0)
    for i in range(n_ears, n):
        strip.triangles[holes[i], 0] = NOBODY
        strip.gain[holes[i]] = 0.0
        strip.spare[strip.counts[SPARE]] = holes[i]
        strip.counts[SPARE] += 1
    ears = strip.ears
    for i in range(n_ears):
        t = holes[i]
        strip.patch[t] = patch
        for k in range(3):
            strip.triangles[t, k] = ears[i, k]
            strip.at_vertex[ears[i, k]] = t
    for i in range(n_ears):
        t = holes[i]
        for k in range(3):
            a, b = ears[i, k], ears[i, (k + 1) % 3]
            beyond = NOBODY
            for j in range(n):
                if strip.corners[j, FROM] == a and strip.corners[j, TO] == b:
                    beyond = strip.corners[j, BEYOND]
            for j in range(n_ears):
                for m in range(3):
                    if ears[j, m] == b and ears[j, (m + 1) % 3] == a:
                        beyond = holes[j]
            _face(strip.triangles, strip.neighbors, t, k, beyond, b)
    _show(strip, n_ears)
    return n_ears


@bare_kernel
def _cut_ears(strip, n):
    """Triangulate the hole whose edges are listed; the ears are `strip.ears[:n]`.

    n is returned, 0 when some triangle would fold.
    """
    ring, ears = strip.ring, strip.ears
    for i in range(n):
        ring[i] = strip.corners[i, FROM]
    n_ears, n_entries = 0, 0
    while n > 2:
        found = False
        for i in range(n):
            a, b, c = ring[i], ring[(i + 1) % n], ring[(i + 2) % n]
            if (
                double_area(strip.domain, a, b, c) < LEAST_AREA
                or double_area(strip.image, a, b, c) < LEAST_AREA
            ):
                continue
            empty = True
            for j in range(3, n):
                if in_circle(strip.domain, a, b, c, ring[(i + j) % n]):
                    empty = False
                    break
            if empty:
                ears[n_ears, 0], ears[n_ears, 1], ears[n_ears, 2] = a, b, c
                n_entries += most_entries(strip, a, b, c)
                n_ears += 1
                for j in range((i + 1) % n, n - 1):
                    ring[j] = ring[j + 1]
                n -= 1
                found = True
                break
        if not found:
            return 0
    return n_ears if strip.counts[ENTRIES] + n_entries <= len(strip.pixel) else 0


@bare_kernel
def _new_triangle(strip):
    if strip.counts[SPARE] > 0:
        strip.counts[SPARE] -= 1
        return strip.spare[strip.counts[SPARE]]
    strip.counts[TRIANGLES] += 1
    return strip.counts[TRIANGLES] - 1


@bare_kernel
def _face(triangles, neighbors, t, k, beyond, end):
    """Make triangles `t` and `beyond` neighbours across edge k of the first, which ends in vertex `end`."""
    neighbors[t, k] = beyond
    if beyond != NOBODY:
        neighbors[beyond, corner_of(triangles, beyond, end)] = t


@bare_kernel
def _paint(strip, t, sign):
    """Add a triangle's colours to the residual, times the sign."""
    a, b, c = strip.triangles[t, 0], strip.triangles[t, 1], strip.triangles[t, 2]
    _add(
        strip.residual, strip.pixel, strip.weights, strip.first[t], strip.last[t], strip.color, a, b, c, sign
    )


@bare_kernel
def _add(residual, pixel, weights, first, last, color, a, b, c, sign):
    for e in range(first, last):
        for k in range(3):
            here = weights[e, 0] * color[a, k] + weights[e, 1] * color[b, k] + weights[e, 2] * color[c, k]
            residual[pixel[e], k] += sign * here


@bare_kernel
def _show(strip, n_holes):
    """Put new triangles into the picture."""
    for i in range(n_holes):
        t = strip.holes[i]
        cover(strip, t)
        _paint(strip, t, -1.0)
        strip.stale[t] = True
        for k in range(3):
            strip.restless[strip.triangles[t, k]] = True
