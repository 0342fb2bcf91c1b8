"""Where control points can be: pixels of the parameter domain, and what lies over them in the image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel
from gcvec.patches.canonical import Foundation
from gcvec.raster.triangle import barycentric

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Seats(NamedTuple):
    """The seats of a foundation, for kernels.

    under        (h w,) int32, the pixel of the domain from where S reaches about the middle of a pixel of
                 the image, -1 where that is none of its patch
    patch        (h w,) int32, the patch of a domain pixel's centre
    taken        (h w,) bool, domain pixels that no further control point can have
    triangle_at  (h w,) int32, the triangle of the bare mesh at a domain pixel's centre
    triangles    (t, 3) int64, those of the bare mesh
    domain       (v, 2) float64, its vertices
    image        (v, 2) float64, where S takes them
    width        columns of the picture
    column, row  of the whole picture where this one, a part of it, begins
    """

    under: NDArray[np.int32]
    patch: NDArray[np.int32]
    taken: NDArray[np.bool_]
    triangle_at: NDArray[np.int32]
    triangles: Ints
    domain: Floats
    image: Floats
    width: int
    column: int
    row: int


def find_seats(foundation: Foundation, blocked: NDArray[np.bool_]) -> Seats:
    """The seats of a foundation, those of the pixels `blocked` `(h, w)` taken."""
    geometry = foundation.geometry
    height, width = blocked.shape
    column, row = foundation.network.origin or (0, 0)
    triangle_at = geometry.triangle_at.ravel()
    patch = geometry.mesh.patch.astype(np.int32)[triangle_at]
    found = Seats(
        np.empty(height * width, np.int32),
        patch,
        blocked.ravel().copy(),
        triangle_at,
        geometry.mesh.triangles,
        geometry.mesh.vertices,
        geometry.image,
        width,
        column,
        row,
    )
    _look_under(found)
    return found


@bare_kernel
def image_of(seats, x, y, at):
    """S at `(x, y)`, by the triangle at the domain pixel `at`."""
    t = seats.triangle_at[at]
    a, b, c = seats.triangles[t, 0], seats.triangles[t, 1], seats.triangles[t, 2]
    domain, image = seats.domain, seats.image
    w0, w1, w2 = barycentric(domain, a, b, c, x, y)
    return (
        w0 * image[a, 0] + w1 * image[b, 0] + w2 * image[c, 0],
        w0 * image[a, 1] + w1 * image[b, 1] + w2 * image[c, 1],
    )


@bare_kernel
def _look_under(seats):
    width = seats.width
    height = len(seats.under) // width
    for y in range(height):
        for x in range(width):
            at = y * width + x
            moved_x, moved_y = image_of(seats, x + 0.5, y + 0.5, at)
            column = min(max(int(2 * (x + 0.5) - moved_x), 0), width - 1)
            row = min(max(int(2 * (y + 0.5) - moved_y), 0), height - 1)
            seats.under[at] = row * width + column
