"""A strip of a picture's mesh that points can be put into and taken out of, with the error it has.

Kernels work on several strips at the same time. Triangles of other strips and patches count as frozen: no
change crosses into them. Every triangle knows what its corners' colours give to the pixels it covers, by the
same box filter that errors are reported with, so a change costs as much as the pixels it concerns.
"""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel, kernel
from gcvec.raster.covering import Scratch, cells, cover_triangle, most_entries_of, scratch_for

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Ints32 = NDArray[np.int32]
Number = TypeVar("Number", np.float64, np.int32)

CANDIDATES = 8
"""Pixels of a triangle, the worst ones, that are tried as control points."""

MOST_CORNERS = 64
"""Corners of a hole that points are put into and taken out of, at most."""

ENTRIES_A_POINT = 100
"""Room for coverage that a new point brings: six triangles, large ones at first."""

ENTRIES_A_PIXEL, ENOUGH_ENTRIES = 2, 3_000_000
"""There need be no more of it than so much a pixel, and at least so much: triangles that go leave gaps, which
are closed in time."""

NOBODY = -1
"""In place of a neighbour where the strip has none, and of the first corner of an unused triangle."""

TRIANGLES, VERTICES, ENTRIES, SPARE, STAMP, EXHAUSTED = range(6)


class Strip(NamedTuple):
    """Mesh, coverage and error of a strip. Arrays have room for what comes.

    counts      (6,) int64: triangles, vertices, entries, unused triangles, a stamp for marks, and 1 once the
                strip is exhausted, a point having found no room in these arrays, else 0
    domain      (v, 2) vertices in the parameter domain
    image       (v, 2) where S takes them
    color       (v, 3)
    seat        (v,) int32, the pixel of a control point in the domain, -1 for other vertices
    whole       (v,) bool, control points all of whose triangles are here
    restless    (v,) bool, vertices about which something has changed since they adapted
    at_vertex   (v,) int32, a triangle of each vertex
    triangles   (t, 3) int32, of positive area; first corner -1 when unused
    neighbors   (t, 3) int32, across the edge from corner k to k + 1; -1: frozen
    patch       (t,) int32
    stale       (t,) bool, triangles whose gain is not known
    gain        (t,) squared error that the best point inside would save
    best        (t,) int32, the pixel where it would be
    first       (t,) int32, first entry of a triangle
    last        (t,) int32, the one after its last
    spare       (t,) int32, stack of unused triangles
    mark        (t,) int32, stamps
    pixel       (e,) int32, of an entry
    weights     (e, 3) float32, what the corners give to it: they add up to the area covered
    residual    (p, 3) float32, photo less picture, in the rows of the strip
    corners     (MOST_CORNERS, 4) int64, scratch: edges of a hole
    ring        (MOST_CORNERS,) int64, scratch: its corners
    ears        (MOST_CORNERS, 3) int64, scratch: triangles that fill it
    holes       (MOST_CORNERS,) int64, scratch: the triangles that have changed
    worst       (CANDIDATES,) scratch
    candidate   (CANDIDATES,) int64, scratch
    places      (3, 2) scratch
    covering    scratch
    photo       (h w, 3) all of it
    first_row   of the picture, where pixels begin
    rows        of the strip
    width       columns of the picture
    """

    counts: Ints
    domain: Floats
    image: Floats
    color: Floats
    seat: Ints32
    whole: NDArray[np.bool_]
    restless: NDArray[np.bool_]
    at_vertex: Ints32
    triangles: Ints32
    neighbors: Ints32
    patch: Ints32
    stale: NDArray[np.bool_]
    gain: Floats
    best: Ints32
    first: Ints32
    last: Ints32
    spare: Ints32
    mark: Ints32
    pixel: Ints32
    weights: NDArray[np.float32]
    residual: NDArray[np.float32]
    corners: Ints
    ring: Ints
    ears: Ints
    holes: Ints
    worst: Floats
    candidate: Ints
    places: Floats
    covering: Scratch
    photo: NDArray[np.float32]
    first_row: int
    rows: int
    width: int


def roomy_strip(
    domain: Floats,
    image: Floats,
    color: Floats,
    seat: Ints,
    triangles: Ints,
    patch: Ints,
    residual: NDArray[np.float32],
    photo: NDArray[np.float32],
    width: int,
) -> Strip:
    """A strip of a mesh, with room for twice as many points again.

    Vertices have one colour each: where they have two, on hard edges, there are two vertices. `residual` and
    `photo` `(h w, 3)` are those of the whole picture.
    """
    n_vertices, n_triangles = len(domain), len(triangles)
    height = len(photo) // width
    at = image[:, 1] if n_vertices else np.zeros(1)
    first_row = int(np.clip(np.floor(at.min()), 0, height - 1))
    last_row = int(np.clip(np.ceil(at.max()), first_row + 1, height))
    own = slice(first_row * width, last_row * width)
    n_pixels = (last_row - first_row) * width
    room = min(n_pixels // 3, 2 * n_vertices + 2000)
    v, t = n_vertices + room, n_triangles + 2 * room + 2
    at_top = image - [0, first_row]
    e = most_entries_of(at_top, triangles, width, last_row - first_row)
    e += min(ENTRIES_A_POINT * room, max(ENTRIES_A_PIXEL * n_pixels, ENOUGH_ENTRIES))

    def roomy(values: NDArray[Number], n: int) -> NDArray[Number]:
        held = np.empty((n, *values.shape[1:]), values.dtype)
        held[: len(values)] = values
        return held

    made = Strip(
        counts=np.array([n_triangles, n_vertices, 0, 0, 0, 0]),
        domain=roomy(domain, v),
        image=roomy(image, v),
        color=roomy(color, v),
        seat=roomy(seat.astype(np.int32), v),
        whole=np.zeros(v, bool),
        restless=np.zeros(v, bool),
        at_vertex=np.empty(v, np.int32),
        triangles=roomy(triangles.astype(np.int32), t),
        neighbors=np.empty((t, 3), np.int32),
        patch=roomy(patch.astype(np.int32), t),
        stale=np.ones(t, bool),
        gain=np.empty(t),
        best=np.empty(t, np.int32),
        first=np.empty(t, np.int32),
        last=np.empty(t, np.int32),
        spare=np.empty(t, np.int32),
        mark=np.zeros(t, np.int32),
        pixel=np.empty(e, np.int32),
        weights=np.empty((e, 3), np.float32),
        residual=residual[own].copy(),
        corners=np.empty((MOST_CORNERS, 4), np.int64),
        ring=np.empty(MOST_CORNERS, np.int64),
        ears=np.empty((MOST_CORNERS, 3), np.int64),
        holes=np.empty(MOST_CORNERS, np.int64),
        worst=np.empty(CANDIDATES),
        candidate=np.empty(CANDIDATES, np.int64),
        places=np.empty((3, 2)),
        covering=scratch_for(width),
        photo=photo,
        first_row=first_row,
        rows=last_row - first_row,
        width=width,
    )
    _find_neighbors(made)
    _assemble(made)
    return made


@bare_kernel
def _assemble(strip):
    for t in range(strip.counts[TRIANGLES]):
        cover(strip, t)
    for v in range(strip.counts[VERTICES]):
        strip.whole[v] = strip.seat[v] >= 0 and _is_surrounded(strip, v)


@kernel
def _find_neighbors(strip):
    """Match the edges, listed by their smaller vertex."""
    n_triangles, n_vertices = strip.counts[TRIANGLES], strip.counts[VERTICES]
    triangles, neighbors, at_vertex = strip.triangles, strip.neighbors, strip.at_vertex
    start = np.zeros(n_vertices + 1, np.int64)
    for t in range(n_triangles):
        for k in range(3):
            at_vertex[triangles[t, k]] = t
            neighbors[t, k] = NOBODY
            start[min(triangles[t, k], triangles[t, (k + 1) % 3]) + 1] += 1
    for v in range(n_vertices):
        start[v + 1] += start[v]
    listed = start[:-1].copy()
    edge = np.empty(start[n_vertices], np.int64)
    for t in range(n_triangles):
        for k in range(3):
            a, b = triangles[t, k], triangles[t, (k + 1) % 3]
            low, high = min(a, b), max(a, b)
            for i in range(start[low], listed[low]):
                other, j = edge[i] // 3, edge[i] % 3
                if max(triangles[other, j], triangles[other, (j + 1) % 3]) == high:
                    neighbors[t, k], neighbors[other, j] = other, t
                    break
            edge[listed[low]] = 3 * t + k
            listed[low] += 1


@bare_kernel
def _place(strip, a, b, c):
    """Corners of a triangle in the strip, into the scratch."""
    places, image, top = strip.places, strip.image, strip.first_row
    places[0, 0], places[0, 1] = image[a, 0], image[a, 1] - top
    places[1, 0], places[1, 1] = image[b, 0], image[b, 1] - top
    places[2, 0], places[2, 1] = image[c, 0], image[c, 1] - top


@bare_kernel
def most_entries(strip, a, b, c):
    """How many entries a triangle may need."""
    _place(strip, a, b, c)
    return cells(strip.places, strip.width, 0, strip.rows)


@bare_kernel
def cover(strip, t):
    """Find the pixels of a triangle."""
    _place(strip, strip.triangles[t, 0], strip.triangles[t, 1], strip.triangles[t, 2])
    first = strip.counts[ENTRIES]
    strip.first[t] = first
    strip.counts[ENTRIES] = cover_triangle(
        strip.places, strip.width, 0, strip.rows, strip.pixel, strip.weights, first, strip.covering
    )
    strip.last[t] = strip.counts[ENTRIES]


@bare_kernel
def make_room(strip, in_vain):
    """Close the gaps between the entries of triangles, if there is little room behind them.

    Returns whether that has brought so little that it is `in_vain` to try again.
    """
    enough = ENTRIES_A_PIXEL // 2 * len(strip.residual)
    if in_vain or strip.counts[ENTRIES] + enough <= len(strip.pixel):
        return in_vain
    _close_gaps(strip)
    return strip.counts[ENTRIES] + 2 * enough > len(strip.pixel)


@bare_kernel
def _close_gaps(strip):
    # Where the entries of a triangle begin, its number stands in for the pixel meanwhile.
    for t in range(strip.counts[TRIANGLES]):
        if strip.triangles[t, 0] == NOBODY or strip.first[t] == strip.last[t]:
            strip.first[t], strip.last[t] = 0, 0
        else:
            strip.mark[t] = strip.pixel[strip.first[t]]
            strip.pixel[strip.first[t]] = -1 - t
    n, e = 0, 0
    while e < strip.counts[ENTRIES]:
        if strip.pixel[e] >= 0:
            e += 1
            continue
        t = -1 - strip.pixel[e]
        strip.pixel[e], strip.mark[t] = strip.mark[t], 0
        length = strip.last[t] - e
        strip.first[t], strip.last[t] = n, n + length
        for _ in range(length):
            strip.pixel[n] = strip.pixel[e]
            for k in range(3):
                strip.weights[n, k] = strip.weights[e, k]
            n += 1
            e += 1
    strip.counts[ENTRIES] = n


@bare_kernel
def corner_of(triangles, t, vertex):
    """Which corner of a triangle a vertex is."""
    if triangles[t, 0] == vertex:
        return 0
    return 1 if triangles[t, 1] == vertex else 2


@bare_kernel
def next_around(triangles, neighbors, t, vertex):
    """The next triangle about a vertex, across the edge that ends there; -1: frozen."""
    return neighbors[t, (corner_of(triangles, t, vertex) + 2) % 3]


@bare_kernel
def _is_surrounded(strip, vertex):
    start = strip.at_vertex[vertex]
    t = start
    for _ in range(strip.counts[TRIANGLES]):
        t = next_around(strip.triangles, strip.neighbors, t, vertex)
        if t == NOBODY:
            return False
        if t == start:
            return True
    return False
