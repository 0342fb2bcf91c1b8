"""From a canvas with its exact error to strips that points can be put into."""

from __future__ import annotations

from dataclasses import dataclass

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


@dataclass(frozen=True)
class Shown:
    """A picture on its canvas, and what it lacks to the photo.

    points    (n, 2) int64, its control points as pixels of the parameter domain
    colors    (k, 3) all those on the canvas
    residual  (h w, 3) float32, the photo less the picture
    photo     (h w, 3) float32
    """

    canvas: Canvas
    points: Ints
    colors: Floats
    residual: NDArray[np.float32]
    photo: NDArray[np.float32]


def begin_placement(shown: Shown, seats: Seats, room: Ints | None, pull: float, shift: float) -> Placement:
    """Start from a picture as it is shown; for `room` and `pull` see `Placement`.

    It is cut into strips of as many triangles; `shift`, in [0, 1), moves the cuts by this share of a strip,
    since nothing changes along them.
    """
    canvas, points = shown.canvas, shown.points
    mesh = canvas.mesh
    corner = canvas.corner_colors
    vertex = np.empty(int(corner.max(initial=-1)) + 1, np.int64)
    vertex[corner] = mesh.triangles
    image = canvas.unit[0].image[: len(mesh.vertices)]
    seat = np.full(len(vertex), -1)
    seat[: mesh.n_points] = points[:, 1] * canvas.foundation.network.width + points[:, 0]
    cuts = _cuts(len(corner), shift)

    def share(which: int) -> Strip:
        own = slice(cuts[which], cuts[which + 1])
        used = np.zeros(len(vertex), bool)
        used[corner[own]] = True
        kept = np.flatnonzero(used)
        number = np.cumsum(used) - 1
        return roomy_strip(
            mesh.vertices[vertex[kept]],
            image[vertex[kept]],
            shown.colors[kept],
            seat[kept],
            number[corner[own]],
            mesh.patch[own],
            shown.residual,
            shown.photo,
            canvas.foundation.network.width,
        )

    largest_first = np.argsort(-np.diff(cuts), kind="stable")
    strips = in_turn(share, largest_first.tolist())
    n_patches = len(canvas.foundation.network.loops)
    error = float(np.sum(shown.residual**2, dtype=np.float64))
    return Placement(strips, seats, n_patches, error, room, pull)


def _cuts(n_triangles: int, shift: float) -> list[int]:
    """Where the strips begin and end in a mesh's triangles, which come row by row."""
    n = max(min(SHARES, n_triangles // TRIANGLES_A_STRIP), 1)
    inner = (np.arange(1, n) - 0.5 + shift) / n * n_triangles
    return [0, *inner.astype(np.int64).tolist(), n_triangles]
