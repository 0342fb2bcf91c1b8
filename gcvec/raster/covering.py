"""Which pixels a triangle covers, how far, and with which corners: the exact box filter.

A pixel's value is the integral of the picture over the pixel's square. Over the part of a triangle inside the
pixel, a linear function integrates to what the part's area and its first moments say; by Green's theorem
these are integrals along the outline of the triangle alone. This is the one place that takes colours at
vertices to pixels: fit, error and rendering all go through it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_AREA = 1e-13
"""Of a pixel: what is smaller is rounding."""

FROM_X, FROM_Y, TO_X, TO_Y, SLOPE, STEEPNESS, SIGN = range(7)
AREA, MOMENT_X, MOMENT_Y, CROSSED, CROSSED_Y = range(5)


class Scratch(NamedTuple):
    """Where `cover_triangle` works.

    edges  (3, 7) those that are not horizontal, from left to right; the sign says if they are so in the
           triangle's own turn
    sums   (width, 5) of a row of pixels: what the edges inside each give to its area and moments, and how
           much they cross of its height, with the first moment of that. Zero between triangles.
    """

    edges: Floats
    sums: Floats


def scratch_for(width: int) -> Scratch:
    """For a picture of so many columns."""
    return Scratch(np.empty((3, 7)), np.zeros((width, 5)))


@bare_kernel
def _list_edges(corners, edges):
    """Returns how many there are."""
    n = 0
    for k in range(3):
        j = k + 1 if k < 2 else 0
        ax, ay, bx, by, sign = corners[k, 0], corners[k, 1], corners[j, 0], corners[j, 1], 1.0
        if ay == by:
            continue
        if ax > bx:
            ax, ay, bx, by, sign = bx, by, ax, ay, -1.0
        slope = (bx - ax) / (by - ay)
        edges[n, FROM_X], edges[n, FROM_Y], edges[n, TO_X], edges[n, TO_Y] = ax, ay, bx, by
        edges[n, SLOPE], edges[n, STEEPNESS], edges[n, SIGN] = slope, 1.0 / slope, sign
        n += 1
    return n


@bare_kernel
def _add_piece(sums, x, u0, v0, u1, v1, sign):
    """The integrals of u, u² / 2, u v, 1 and v over dv along a straight piece of an edge, (u, v) being
    relative to the pixel's corner."""
    dv = sign * (v1 - v0)
    sums[x, AREA] += dv * (u0 + u1) / 2
    sums[x, MOMENT_X] += dv * (u0 * u0 + u0 * u1 + u1 * u1) / 6
    sums[x, MOMENT_Y] += dv * ((2 * u0 + u1) * v0 + (u0 + 2 * u1) * v1) / 6
    sums[x, CROSSED] += dv
    sums[x, CROSSED_Y] += dv * (v0 + v1) / 2


@bare_kernel
def _follow_edges(edges, n, y, width, sums):
    """Add what the n edges give to the pixels of the row y.

    Returns the first and the last column that may be covered, and what of the row is crossed left of the
    picture, with its moment.
    """
    low, high = width, -1
    crossed, crossed_y = 0.0, 0.0
    for k in range(n):
        x0, v0, x1, v1 = edges[k, FROM_X], edges[k, FROM_Y] - y, edges[k, TO_X], edges[k, TO_Y] - y
        if min(v0, v1) >= 1.0 or max(v0, v1) <= 0.0:
            continue
        slope, steepness, sign = edges[k, SLOPE], edges[k, STEEPNESS], edges[k, SIGN]
        # Only the part in the row; its ends stay in order whatever rounding does.
        at_top = x0 - v0 * slope
        at_bottom = x0 + (1.0 - v0) * slope
        if v0 < 0.0:
            x0, v0 = min(at_top, x1), 0.0
        elif v0 > 1.0:
            x0, v0 = min(at_bottom, x1), 1.0
        if v1 < 0.0:
            x1, v1 = max(at_top, x0), 0.0
        elif v1 > 1.0:
            x1, v1 = max(at_bottom, x0), 1.0
        if x0 < 0.0:
            low = 0
            v = v1 if x1 <= 0.0 else v0 - x0 * steepness
            crossed += sign * (v - v0)
            crossed_y += sign * (v - v0) * (v + v0) / 2
            if x1 <= 0.0:
                high = max(high, 0)
                continue
            x0, v0 = 0.0, v
        if x0 >= width:
            high = width - 1
            continue
        x, last = int(x0), int(x1)
        low, high = min(low, x), max(high, min(last, width - 1))
        u, v = x0 - x, v0
        while x < last and x < width:
            v_there = v0 + (x + 1 - x0) * steepness
            _add_piece(sums, x, u, v, 1.0, v_there, sign)
            x += 1
            u, v = 0.0, v_there
        if x < width:
            _add_piece(sums, x, u, v, x1 - x, v1, sign)
    return low, high, crossed, crossed_y


@bare_kernel
def cover_triangle(corners, width, top, bottom, pixel, weights, count, scratch):
    """Append this triangle's `(pixel, weight of each corner)` entries in the rows from `top` to `bottom`;
    returns the new count.

    Pixels come in ascending order: row by row, and along it from left to right. The weights of one entry add
    up to the area of the triangle inside the pixel. To the left of an edge as much of a pixel is covered as
    the edge crosses of its height.
    """
    x0, y0 = corners[0, 0], corners[0, 1]
    x1, y1 = corners[1, 0], corners[1, 1]
    x2, y2 = corners[2, 0], corners[2, 1]
    twice_area = (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)
    if twice_area == 0.0:
        return count
    # Gradients of the second and third barycentric coordinates.
    gx1, gy1 = (y2 - y0) / twice_area, -(x2 - x0) / twice_area
    gx2, gy2 = -(y1 - y0) / twice_area, (x1 - x0) / twice_area
    edges, sums = scratch.edges, scratch.sums
    n_edges = _list_edges(corners, edges)
    lowest, highest = min(y0, y1, y2), max(y0, y1, y2)
    if highest <= top or lowest >= bottom:
        return count
    for y in range(int(max(lowest, top)), min(int(highest) + 1, bottom)):
        low, high, crossed, crossed_y = _follow_edges(edges, n_edges, y, width, sums)
        for x in range(low, high + 1):
            # The outline is closed: what is crossed further right is what is crossed up to here, negative.
            crossed += sums[x, CROSSED]
            crossed_y += sums[x, CROSSED_Y]
            area = sums[x, AREA] - crossed
            if abs(area) > LEAST_AREA:
                # Moments about the first corner.
                mx = sums[x, MOMENT_X] - crossed / 2 + (x - x0) * area
                my = sums[x, MOMENT_Y] - crossed_y + (y - y0) * area
                weight1, weight2 = gx1 * mx + gy1 * my, gx2 * mx + gy2 * my
                pixel[count] = y * width + x
                weights[count, 0], weights[count, 1], weights[count, 2] = (
                    area - weight1 - weight2,
                    weight1,
                    weight2,
                )
                count += 1
            for i in range(5):
                sums[x, i] = 0.0
    return count


@bare_kernel
def cells(corners, width, top, bottom):
    """Upper bound of the number of pixels a triangle touches in the rows from `top` to `bottom`.

    It is that of the box around it; and no more pixels lie inside than its area says, while an edge passes
    through |dx| + |dy| + 3 at most.
    """
    low_x, high_x = (
        min(corners[0, 0], corners[1, 0], corners[2, 0]),
        max(corners[0, 0], corners[1, 0], corners[2, 0]),
    )
    low_y, high_y = (
        min(corners[0, 1], corners[1, 1], corners[2, 1]),
        max(corners[0, 1], corners[1, 1], corners[2, 1]),
    )
    nx = min(np.ceil(high_x), width) - max(np.floor(low_x), 0.0)
    ny = min(np.ceil(high_y), bottom) - max(np.floor(low_y), top)
    (ax, ay), (bx, by), (cx, cy) = corners[0], corners[1], corners[2]
    area = abs((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) / 2
    return int(min(max(nx, 0.0) * max(ny, 0.0), area + 2 * (high_x - low_x + high_y - low_y) + 9))


def most_entries_of(vertices: Floats, triangles: Ints, width: int, height: int) -> int:
    """Upper bound of the entries of all triangles: what is reserved for them and not written to takes no
    memory."""
    return int(most_entries(vertices, triangles, width, height, 0, len(triangles), np.empty((3, 2))))


@bare_kernel
def most_entries(vertices, triangles, width, height, first, last, corners):
    """Upper bound of the entries of the triangles `first` to `last`."""
    total = 0
    for t in range(first, last):
        for k in range(3):
            corners[k, 0], corners[k, 1] = vertices[triangles[t, k], 0], vertices[triangles[t, k], 1]
        total += cells(corners, width, 0, height)
    return total
