"""From a canvas with its exact error to strips that points can be put into."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.greedy.placement import Placement
from gcvec.greedy.seats import Seats
from gcvec.greedy.strip import Strip, roomy_strip
from gcvec.parallel import SHARES, in_turn
from gcvec.patches.canonical import Canvas

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TRIANGLES_A_STRIP = 1500
"""Smaller strips are not worth a thread."""


def begin_placement(
    canvas: Canvas,
    points: Ints,
    colors: Floats,
    residual: NDArray[np.float32],
    photo: NDArray[np.float32],
    seats: Seats,
    room: Ints | None,
    pull: float,
    shift: float,
) -> Placement:
    """Start from a canvas with control points at these pixels `(n, 2)` of the parameter domain.

    `colors` `(k, 3)` are all those on it; `residual` is `photo` less its picture, `(h w, 3)`.

    The picture is cut into strips of as many triangles; `shift`, in [0, 1), moves the cuts by this share of
    a strip, since nothing changes along them.
    """
    mesh = canvas.mesh
    corner = canvas.corner_colors
    vertex = np.empty(int(corner.max(initial=-1)) + 1, np.int64)
    vertex[corner] = mesh.triangles
    image = canvas.unit[0].image[: len(mesh.vertices)]
    seat = np.full(len(vertex), -1)
    seat[: mesh.n_points] = points[:, 1] * canvas.foundation.network.width + points[:, 0]
    of_strip = _strips(mesh.vertices[mesh.triangles, 1].sum(axis=1), shift)

    def share(which: int) -> Strip:
        own = np.flatnonzero(of_strip == which)
        used = np.zeros(len(vertex), bool)
        used[corner[own]] = True
        kept = np.flatnonzero(used)
        number = np.cumsum(used) - 1
        return roomy_strip(
            mesh.vertices[vertex[kept]],
            image[vertex[kept]],
            colors[kept],
            seat[kept],
            number[corner[own]],
            mesh.patch[own],
            residual,
            photo,
            canvas.foundation.network.width,
        )

    largest_first = np.argsort(-np.bincount(of_strip, minlength=1), kind="stable")
    strips = in_turn(share, largest_first.tolist())
    return Placement(strips, seats, float(np.sum(residual**2, dtype=np.float64)), room, pull)


def _strips(height: Floats, shift: float) -> Ints:
    """Number of the strip of each triangle `(t,)`, by its `height`."""
    n = min(SHARES, len(height) // TRIANGLES_A_STRIP)
    if n < 2:
        return np.zeros(len(height), np.int64)
    cuts = np.quantile(height, (np.arange(1, n) - 0.5 + shift) / n)
    return np.searchsorted(cuts, height)
