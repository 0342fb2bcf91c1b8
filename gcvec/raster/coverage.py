"""Which triangles of a picture cover which pixels, and how; and the matrix from colours to pixels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.kernels import bare_kernel, kernel
from gcvec.parallel import in_shares, in_turn
from gcvec.raster.covering import cover_triangle, most_entries, scratch_for

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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
def _rows(start, end, pixel, weights, corner_color, n_colors, first_pixel, last_pixel):
    """Compressed rows, one for each pixel of a range, of the weights of colours, those of one colour added
    up (Gustavson 1978)."""
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
    # Where the last weight of each colour is.
    place = np.full(n_colors, -1, np.int32)
    n = 0
    for p in range(n_pixels):
        for i in range(first[p], first[p + 1]):
            for k in range(3):
                color = corner_color[owner[i], k]
                if place[color] < row_start[p]:
                    place[color], columns[n], values[n] = n, color, 0.0
                    n += 1
                values[place[color]] += weights[by_pixel[i], k]
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
            return first, last, most_entries(vertices, triangles, width, height, first, last, corners)

        shares = in_shares(need, n)
        begin = np.cumsum([0] + [most for _, _, most in shares])
        # What is never written to takes no memory.
        self.pixel, self.weights = np.empty(begin[-1], np.int32), np.empty((begin[-1], 3), precision)

        def fill(share: tuple[int, int, int], count: int) -> None:
            out = (self.start, self.end, self.pixel, self.weights, np.empty((3, 2)), scratch_for(width))
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
                self.start, self.end, self.pixel, self.weights, corner_color, n_colors, first, last
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
