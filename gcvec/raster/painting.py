"""Triangles whose corners have colours → pictures: filtered exactly, or sampled at the centres of pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel, kernel
from gcvec.parallel import in_shares
from gcvec.raster.covering import cells, cover_triangle, scratch_for
from gcvec.raster.triangle import barycentric, double_area

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def _paint(vertices, triangles, colors, corner_color, width, first_row, last_row, picture, scratch):
    """Add the rows `first_row` to `last_row` of the picture, which is 0 there."""
    channels = colors.shape[1]
    corners = np.empty((3, 2))
    pixel = np.empty(1024, np.int32)
    weights = np.empty((1024, 3))
    for t in range(len(triangles)):
        for k in range(3):
            corners[k] = vertices[triangles[t, k]]
        need = cells(corners, width, first_row, last_row)
        if need == 0:
            continue
        if need > len(pixel):
            pixel = np.empty(need, np.int32)
            weights = np.empty((need, 3))
        count = cover_triangle(corners, width, first_row, last_row, pixel, weights, 0, scratch)
        for e in range(count):
            for k in range(3):
                for c in range(channels):
                    picture[pixel[e], c] += weights[e, k] * colors[corner_color[t, k], c]


def paint(
    vertices: Floats, triangles: Ints, colors: Floats, corner_color: Ints, width: int, height: int
) -> Floats:
    """The box-filtered picture `(height, width, c)` of triangles whose corners have
    `colors[corner_color]`."""
    colors = np.ascontiguousarray(colors)
    picture = np.zeros((height * width, colors.shape[1]))
    mesh = vertices, triangles, colors, corner_color
    in_shares(
        lambda first, last: _paint(*mesh, width, first, last, picture, scratch_for(width)),
        height,
    )
    return picture.reshape(height, width, -1)


@bare_kernel
def _locate(vertices, triangles, width, first_row, last_row, owner):
    """Find the triangles of the pixel centres in some rows: where several hold one, the last. What is no more
    than a line holds none."""
    for t in range(len(triangles)):
        a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        if double_area(vertices, a, b, c) == 0:
            continue
        ax, ay = vertices[a, 0], vertices[a, 1]
        bx, by = vertices[b, 0], vertices[b, 1]
        cx, cy = vertices[c, 0], vertices[c, 1]
        y_first = max(int(np.ceil(min(ay, by, cy) - 0.5)), first_row)
        y_last = min(int(np.floor(max(ay, by, cy) - 0.5)), last_row - 1)
        x_first = max(int(np.ceil(min(ax, bx, cx) - 0.5)), 0)
        x_last = min(int(np.floor(max(ax, bx, cx) - 0.5)), width - 1)
        for y in range(y_first, y_last + 1):
            for x in range(x_first, x_last + 1):
                px, py = x + 0.5, y + 0.5
                if (
                    (bx - ax) * (py - ay) - (by - ay) * (px - ax) >= 0
                    and (cx - bx) * (py - by) - (cy - by) * (px - bx) >= 0
                    and (ax - cx) * (py - cy) - (ay - cy) * (px - cx) >= 0
                ):
                    owner[y, x] = t


def triangle_at_pixel_centres(
    vertices: Floats, triangles: Ints, width: int, height: int
) -> NDArray[np.int32]:
    """`(height, width) int32`: the triangle that holds each pixel's centre, -1 where there is none."""
    owner = np.full((height, width), -1, np.int32)
    in_shares(lambda first, last: _locate(vertices, triangles, width, first, last, owner), height)
    return owner


@kernel
def _sample(vertices, triangles, colors, corner_color, owner):
    height, width = owner.shape
    picture = np.zeros((height * width, colors.shape[1]))
    for y in range(height):
        for x in range(width):
            t = owner[y, x]
            if t < 0:
                continue
            a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
            w0, w1, w2 = barycentric(vertices, a, b, c, x + 0.5, y + 0.5)
            for k in range(colors.shape[1]):
                picture[y * width + x, k] = (
                    w0 * colors[corner_color[t, 0], k]
                    + w1 * colors[corner_color[t, 1], k]
                    + w2 * colors[corner_color[t, 2], k]
                )
    return picture


def sample(
    vertices: Floats, triangles: Ints, colors: Floats, corner_color: Ints, width: int, height: int
) -> Floats:
    """The picture `(height, width, c)` at pixel centres, without filtering."""
    owner = triangle_at_pixel_centres(vertices, triangles, width, height)
    picture = _sample(vertices, triangles, np.ascontiguousarray(colors), corner_color, owner)
    return np.asarray(picture).reshape(height, width, -1)
