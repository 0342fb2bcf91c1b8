"""Which triangles cover which pixels, and how: the exact box filter.

A pixel's value is the integral of the picture over the pixel's square. Over the part of a triangle inside the
pixel a linear function integrates to its value at the part's centroid times the part's area; both come from
clipping the triangle to the square. This is the one place that takes colours at vertices to pixels: fit,
error and rendering all go through it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.kernels import bare_kernel, kernel
from gcvec.parallel import in_shares, in_turn

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

POLYGONS = 5, 12, 2
"""Scratch of `cover_triangle`: polygons that a triangle is cut into, and room for their corners."""


@bare_kernel
def _split(source, n, axis, bound, low, high):
    """Cut a convex polygon of n corners along an axis-parallel line (Sutherland and Hodgman 1974).

    What lies before the line goes to `low`, and behind it to `high`; returns how many corners they have.
    """
    n_low, n_high = 0, 0
    before_x, before_y = source[n - 1, 0], source[n - 1, 1]
    before = source[n - 1, axis] - bound
    for i in range(n):
        x, y = source[i, 0], source[i, 1]
        here = source[i, axis] - bound
        if (before < 0.0 and here > 0.0) or (before > 0.0 and here < 0.0):
            t = before / (before - here)
            if axis == 0:
                at_x, at_y = bound, before_y + t * (y - before_y)
            else:
                at_x, at_y = before_x + t * (x - before_x), bound
            low[n_low, 0], low[n_low, 1] = at_x, at_y
            high[n_high, 0], high[n_high, 1] = at_x, at_y
            n_low += 1
            n_high += 1
        if here <= 0.0:
            low[n_low, 0], low[n_low, 1] = x, y
            n_low += 1
        if here >= 0.0:
            high[n_high, 0], high[n_high, 1] = x, y
            n_high += 1
        before_x, before_y, before = x, y, here
    return n_low, n_high


@bare_kernel
def _area_centroid(p, n):
    """Signed area and centroid of a convex polygon, relative to its first corner for accuracy."""
    x0, y0 = p[0, 0], p[0, 1]
    area, cx, cy = 0.0, 0.0, 0.0
    for i in range(1, n - 1):
        ax, ay = p[i, 0] - x0, p[i, 1] - y0
        bx, by = p[i + 1, 0] - x0, p[i + 1, 1] - y0
        cross = ax * by - ay * bx
        area += cross
        cx += cross * (ax + bx)
        cy += cross * (ay + by)
    if area == 0.0:
        return 0.0, x0, y0
    return area / 2, x0 + cx / (3 * area), y0 + cy / (3 * area)


@bare_kernel
def cover_triangle(corners, width, top, bottom, pixel, weights, count, scratch):
    """Append this triangle's `(pixel, weight of each corner)` entries in the rows from `top` to `bottom`;
    returns the new count.

    Pixels come in ascending order. The weights of one entry add up to the area of the triangle inside the
    pixel. `scratch` has the shape `POLYGONS`.
    """
    x0, y0 = corners[0, 0], corners[0, 1]
    x1, y1 = corners[1, 0], corners[1, 1]
    x2, y2 = corners[2, 0], corners[2, 1]
    twice_area = (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)
    if twice_area == 0.0:
        return count
    gx1, gy1 = (y2 - y0) / twice_area, -(x2 - x0) / twice_area
    gx2, gy2 = -(y1 - y0) / twice_area, (x1 - x0) / twice_area
    # Barycentric coordinates are linear: the square is inside if they stay positive over it.
    r1 = 0.5 * (abs(gx1) + abs(gy1))
    r2 = 0.5 * (abs(gx2) + abs(gy2))
    r0 = 0.5 * (abs(gx1 + gx2) + abs(gy1 + gy2))
    whole = 1.0 if twice_area > 0.0 else -1.0
    lowest, highest = min(y0, y1, y2), max(y0, y1, y2)
    first_row, last_row = max(int(np.floor(lowest)), top), min(int(np.ceil(highest)), bottom)
    below, strip, right, cell, spare = scratch[0], scratch[1], scratch[2], scratch[3], scratch[4]
    for k in range(3):
        below[k, 0], below[k, 1] = corners[k, 0], corners[k, 1]
    n_below = 3
    if lowest < first_row:
        _, n_below = _split(below, n_below, 1, float(first_row), strip, spare)
        below, spare = spare, below
    for y in range(first_row, last_row):
        if highest > y + 1:
            n, n_below = _split(below, n_below, 1, float(y + 1), strip, spare)
            below, spare = spare, below
        else:
            n = n_below
            strip, below = below, strip
        if n < 3:
            continue
        low, high = strip[0, 0], strip[0, 0]
        for i in range(1, n):
            low, high = min(low, strip[i, 0]), max(high, strip[i, 0])
        # Of the strip only what lies to the right of `cut` is left.
        cut = low
        for x in range(max(int(np.floor(low)), 0), min(int(np.ceil(high)), width)):
            b1 = gx1 * (x + 0.5 - x0) + gy1 * (y + 0.5 - y0)
            b2 = gx2 * (x + 0.5 - x0) + gy2 * (y + 0.5 - y0)
            b0 = 1.0 - b1 - b2
            area = whole
            if b0 < r0 or b1 < r1 or b2 < r2:
                if cut < x:
                    _, n = _split(strip, n, 0, float(x), cell, right)
                    strip, right = right, strip
                n_cell = n
                if high > x + 1:
                    cut = float(x + 1)
                    n_cell, n = _split(strip, n, 0, cut, cell, right)
                    strip, right = right, strip
                else:
                    strip, cell = cell, strip
                if n_cell < 3:
                    continue
                area, cx, cy = _area_centroid(cell, n_cell)
                if area == 0.0:
                    continue
                b1 = gx1 * (cx - x0) + gy1 * (cy - y0)
                b2 = gx2 * (cx - x0) + gy2 * (cy - y0)
                b0 = 1.0 - b1 - b2
            pixel[count] = y * width + x
            weights[count, 0], weights[count, 1], weights[count, 2] = area * b0, area * b1, area * b2
            count += 1
    return count


@bare_kernel
def cells(corners, width, top, bottom):
    """Upper bound of the number of pixels a triangle touches in the rows from `top` to `bottom`."""
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
    return int(max(nx, 0.0) * max(ny, 0.0))


def most_entries_of(vertices: Floats, triangles: Ints, width: int, height: int) -> int:
    """Upper bound of the entries of all triangles: what is reserved for them and not written to takes no
    memory."""
    return int(_most_entries(vertices, triangles, width, height, 0, len(triangles), np.empty((3, 2))))


@bare_kernel
def _most_entries(vertices, triangles, width, height, first, last, corners):
    """Upper bound of the entries of the triangles `first` to `last`."""
    total = 0
    for t in range(first, last):
        for k in range(3):
            corners[k, 0], corners[k, 1] = vertices[triangles[t, k], 0], vertices[triangles[t, k], 1]
        total += cells(corners, width, 0, height)
    return total


@bare_kernel
def _coverage(
    vertices, triangles, width, height, first, last, count, start, end, pixel, weights, corners, scratch
):
    """Write the entries of the triangles `first` to `last` from `count` on, and where each one's lie."""
    for t in range(first, last):
        for k in range(3):
            corners[k, 0], corners[k, 1] = vertices[triangles[t, k], 0], vertices[triangles[t, k], 1]
        start[t] = count
        count = cover_triangle(corners, width, 0, height, pixel, weights, count, scratch)
        end[t] = count


@bare_kernel
def _lies_elsewhere(pixel, start, end, first_pixel, last_pixel):
    """Whether none of a triangle's entries, in ascending order, is of a pixel of the range."""
    return start == end or pixel[start] >= last_pixel or pixel[end - 1] < first_pixel


@kernel
def _rows(start, end, pixel, weights, corner_color, first_pixel, last_pixel):
    """Compressed rows, one for each pixel of a range, of the weights of colours, those of one colour added
    up."""
    n_pixels = last_pixel - first_pixel
    first = np.zeros(n_pixels + 1, np.int64)
    for t in range(len(start)):
        if _lies_elsewhere(pixel, start[t], end[t], first_pixel, last_pixel):
            continue
        for e in range(start[t], end[t]):
            if first_pixel <= pixel[e] < last_pixel:
                first[pixel[e] - first_pixel + 1] += 1
    for p in range(n_pixels):
        first[p + 1] += first[p]
    by_pixel = np.empty(first[n_pixels], np.int32)
    owner = np.empty(first[n_pixels], np.int32)
    at = first[:-1].copy()
    for t in range(len(start)):
        if _lies_elsewhere(pixel, start[t], end[t], first_pixel, last_pixel):
            continue
        for e in range(start[t], end[t]):
            if first_pixel <= pixel[e] < last_pixel:
                p = pixel[e] - first_pixel
                by_pixel[at[p]] = e
                owner[at[p]] = t
                at[p] += 1
    row_start = np.zeros(n_pixels + 1, np.int64)
    columns = np.empty(3 * len(by_pixel), np.int32)
    values = np.empty(3 * len(by_pixel), weights.dtype)
    n = 0
    for p in range(n_pixels):
        for i in range(first[p], first[p + 1]):
            for k in range(3):
                color = corner_color[owner[i], k]
                j = row_start[p]
                while j < n and columns[j] != color:
                    j += 1
                if j == n:
                    columns[n] = color
                    values[n] = 0.0
                    n += 1
                values[j] += weights[by_pixel[i], k]
        row_start[p + 1] = n
    return row_start, columns[:n], values[:n]


class Coverage:
    """Which triangles cover which pixels, and how: `(pixel, triangle, three corner weights)` entries.

    start, end  (t,) first entry of each triangle, and the one after its last; there may be gaps between them
    pixel       (n,) int32, row-major pixel of an entry
    weights     (n, 3) summing to the area of the triangle inside the pixel
    """

    def __init__(
        self, vertices: Floats, triangles: Ints, width: int, height: int, precision: type = np.float64
    ) -> None:
        self.width, self.height = width, height
        n = len(triangles)
        self.start, self.end = np.empty(n, np.int64), np.empty(n, np.int64)

        def need(first: int, last: int) -> tuple[int, int, int]:
            corners = np.empty((3, 2))
            return first, last, _most_entries(vertices, triangles, width, height, first, last, corners)

        shares = in_shares(need, n)
        begin = np.cumsum([0] + [most for _, _, most in shares])
        # What is never written to takes no memory.
        self.pixel, self.weights = np.empty(begin[-1], np.int32), np.empty((begin[-1], 3), precision)

        def fill(share: tuple[int, int, int], count: int) -> None:
            out = (self.start, self.end, self.pixel, self.weights, np.empty((3, 2)), np.empty(POLYGONS))
            _coverage(vertices, triangles, width, height, share[0], share[1], count, *out)

        in_turn(lambda pair: fill(*pair), list(zip(shares, begin.tolist(), strict=False)))

    def entries(self) -> Ints:
        """`(n,)` the entries in use."""
        length = self.end - self.start
        within = np.arange(length.sum()) - np.repeat(np.cumsum(length) - length, length)
        return np.asarray(np.repeat(self.start, length) + within)

    def matrix(self, corner_color: Ints, n_colors: int) -> sparse.csr_array:
        """B `(pixels, n_colors)`: from the colours that the triangles' corners `(t, 3)` refer to, to
        pixels."""
        n_pixels = self.width * self.height
        shares = in_shares(
            lambda first, last: _rows(
                self.start, self.end, self.pixel, self.weights, corner_color, first, last
            ),
            n_pixels,
        )
        starts, columns, values = map(list, zip(*shares, strict=True))
        del shares
        before = np.cumsum([0] + [len(share) for share in columns])
        start = np.concatenate([share[:-1] + n for share, n in zip(starts, before[:-1], strict=True)])
        rows = np.append(start, before[-1]).astype(np.int32)
        return sparse.csr_array((_joined(values), _joined(columns), rows), shape=(n_pixels, n_colors))


def _joined(parts: list[NDArray[Any]]) -> NDArray[Any]:
    """The parts `(n,)` one after another; each is let go once copied, so that not all is there twice."""
    whole = np.empty(sum(map(len, parts)), parts[0].dtype)
    end = len(whole)
    while parts:
        part = parts.pop()
        whole[end - len(part) : end] = part
        end -= len(part)
    return whole
