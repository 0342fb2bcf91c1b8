"""Triangles by the numbers of their corners: areas, and the weights of corners at a point.

`double_area` and `barycentric` are for kernels, one triangle at a time; `double_areas` and `barycentric_at`
the same for arrays of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@bare_kernel
def double_area(points, a, b, c):
    """Twice the signed area of the triangle of three points; positive for those that run a, b, c as x to y
    does."""
    return (points[b, 0] - points[a, 0]) * (points[c, 1] - points[a, 1]) - (points[b, 1] - points[a, 1]) * (
        points[c, 0] - points[a, 0]
    )


@bare_kernel
def barycentric(points, a, b, c, x, y):
    """Weights of three points at `(x, y)`. They sum to 1; none is finite where the three are in line."""
    ux, uy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    vx, vy = points[c, 0] - points[a, 0], points[c, 1] - points[a, 1]
    px, py = x - points[a, 0], y - points[a, 1]
    area = ux * vy - uy * vx
    s, t = (px * vy - py * vx) / area, (ux * py - uy * px) / area
    return 1 - s - t, s, t


def double_areas(points: Floats, triangles: Ints) -> Floats:
    """Twice the signed areas `(t,)` of the triangles `(t, 3)` of points `(n, 2)`."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return np.asarray(ux * vy - uy * vx)


def barycentric_at(points: Floats, triangles: Ints, at: Floats) -> Floats:
    """Weights `(t, 3)` of the corners of each triangle `(t, 3)` at a place `(t, 2)` of its own."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy), (px, py) = (b - a).T, (c - a).T, (at - a).T
    area = ux * vy - uy * vx
    s, t = (px * vy - py * vx) / area, (ux * py - uy * px) / area
    return np.stack([1 - s - t, s, t], axis=1)
