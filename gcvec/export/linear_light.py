"""Meshes for programs that interpolate colours in linear light, where this picture is linear in sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.export.triangles import Triangles

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOLERANCE = 1 / 255
"""Largest error, in sRGB, of interpolating along an edge in linear light."""

SHORTEST = 1.0
"""Edges this short, in pixels, are left whole."""


def linear_light(srgb: Floats) -> Floats:
    """sRGB in [0, 1] as linear light (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def srgb(light: Floats) -> Floats:
    """Linear light in [0, 1] as sRGB."""
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


def subdivided(triangles: Triangles, tolerance: float = TOLERANCE) -> Triangles:
    """The same picture, with edges cut until linear light errs by at most `tolerance` along them.

    An edge that two triangles share is cut for both, also where their colours differ, so that no crack opens.
    """
    while True:
        edges = np.stack([triangles.corners, np.roll(triangles.corners, -1, axis=1)], axis=2).reshape(-1, 2)
        _, number = _distinct(triangles.places[edges])
        length = np.hypot(*(triangles.positions[edges[:, 1]] - triangles.positions[edges[:, 0]]).T)
        candidates = np.flatnonzero(length > SHORTEST)
        cut = np.zeros(number.max() + 1, bool)
        cut[number[candidates[_error(triangles.colors[edges[candidates]]) > tolerance]]] = True
        if not cut.any():
            return triangles
        triangles = _cut(triangles, edges, number, cut)


def _distinct(pairs: Ints) -> tuple[Ints, Ints]:
    """The distinct unordered pairs `(k, 2)` among pairs `(n, 2)`, and which of them each one is."""
    low, high = np.sort(pairs, axis=1).T
    keys, which = np.unique(low << 32 | high, return_inverse=True)
    return np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1), which


def _error(ends: Floats) -> Floats:
    """`(n,)` largest error along edges `(n, 2, 3)`, measured at three points."""
    along = np.arange(1, 4)[:, None, None] / 4
    a, b = ends[:, 0], ends[:, 1]
    blended = srgb((1 - along) * linear_light(a) + along * linear_light(b))
    return np.asarray(np.abs(blended - ((1 - along) * a + along * b)).max(axis=(0, 2)))


def _cut(triangles: Triangles, edges: Ints, number: Ints, cut: NDArray[np.bool_]) -> Triangles:
    """Halve the edges `(3 t, 2)` whose geometric `number` is `cut`."""
    halved = np.flatnonzero(cut[number])
    ends, which = _distinct(edges[halved])
    middle = np.full(len(edges), -1, np.int64)
    middle[halved] = len(triangles.positions) + which
    place = np.zeros(len(ends), np.int64)
    place[which] = triangles.places.max() + 1 + number[halved]
    return Triangles(
        np.concatenate([triangles.positions, triangles.positions[ends].mean(axis=1)]),
        np.concatenate([triangles.colors, triangles.colors[ends].mean(axis=1)]),
        _split(triangles.corners, middle.reshape(-1, 3)),
        np.concatenate([triangles.places, place]),
    )


def _split(corners: Ints, middle: Ints) -> Ints:
    """Triangles `(t, 3)` with the `middle` of their edges (-1: not halved), cut into two, three or four."""
    count = (middle >= 0).sum(axis=1)
    # Turn each so that its first edge is halved and, of two, the second too.
    first = np.where(count == 1, (middle >= 0).argmax(axis=1), ((middle < 0).argmax(axis=1) + 1) % 3)
    turn = (np.where(count == 3, 0, first)[:, None] + np.arange(3)) % 3
    (a, b, c), (ab, bc, ca) = (np.take_along_axis(x, turn, axis=1).T for x in (corners, middle))
    pieces = [corners[count == 0]]
    for n, parts in (
        (1, ((a, ab, c), (ab, b, c))),
        (2, ((a, ab, c), (ab, b, bc), (ab, bc, c))),
        (3, ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))),
    ):
        pieces += [np.stack(part, axis=1)[count == n] for part in parts]
    return np.concatenate(pieces)
