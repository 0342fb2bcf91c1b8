"""An arc along pixel edges -> the fewest straight lines that have every pixel's centre on the same side.

A pixel is in a polygon when its centre is, so such lines stand for the same pixels as the staircase does.
They stay within half a pixel of it: each passes between the centres at both sides of every edge that it
replaces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel


def straightened(points: NDArray[np.int32]) -> NDArray[np.float64]:
    """Vertices `(m, 2)`, multiples of 1/2, from the first to the last lattice point of an arc `(n, 2)`.

    There are as few of them as can be with vertices where the arc turns and halfway between two turns; among
    so few, those that lie closest to the arc.
    """
    steps = np.diff(points, axis=0)
    turns = np.flatnonzero((steps[1:] != steps[:-1]).any(axis=1)) + 1
    corners = np.concatenate([[0], turns, [len(steps)]])
    # From here on everything is in half pixels, also along the arc: then it is whole, and comparisons exact.
    places = np.sort(np.concatenate([2 * corners, corners[1:] + corners[:-1]]))
    doubled = np.repeat(2 * points.astype(np.int64), 2, axis=0)[:-1]
    doubled[1::2] += steps
    middles = doubled[1::2]
    left = np.column_stack([steps[:, 1], -steps[:, 0]])
    chosen = _fewest(places, doubled[places], middles + left, middles - left, _moments(middles))
    return np.asarray(doubled[places[chosen]] / 2, dtype=np.float64)


def _moments(points: NDArray[np.int64]) -> NDArray[np.float64]:
    """Sums `(n + 1, 5)` of x, y, x², xy and y² over the first 0 to n points."""
    x, y = points.astype(np.float64).T
    return np.pad(np.column_stack([x, y, x * x, x * y, y * y]).cumsum(axis=0), ((1, 0), (0, 0)))


@kernel
def _fewest(places, vertices, left, right, moments):
    """Which of the vertices `(c, 2)`, at these places along the arc, make the shortest way from the first to
    the last; `left` and `right` `(n, 2)` are the centres at both sides of every pixel edge."""
    count = len(places)
    lines = np.full(count, count, np.int64)
    error = np.full(count, np.inf)
    before = np.full(count, -1, np.int64)
    lines[0], error[0] = 0, 0.0
    for a in range(count - 1):
        x, y = vertices[a, 0], vertices[a, 1]
        first = edge = (places[a] + 1) // 2
        # Lines from here lie between these two directions; at first anywhere.
        left_x = left_y = right_x = right_y = 0
        for b in range(a + 1, count):
            while 2 * edge < places[b]:
                u, v = left[edge, 0] - x, left[edge, 1] - y
                if edge == first or left_x * v - left_y * u > 0:
                    left_x, left_y = u, v
                u, v = right[edge, 0] - x, right[edge, 1] - y
                if edge == first or right_x * v - right_y * u < 0:
                    right_x, right_y = u, v
                edge += 1
            if edge > first and left_x * right_y - left_y * right_x <= 0:
                break
            u, v = vertices[b, 0] - x, vertices[b, 1] - y
            if edge > first and (u * left_y - v * left_x >= 0 or u * right_y - v * right_x <= 0):
                continue
            further = error[a] + _squared_distance(moments, first, edge, x, y, u, v)
            if lines[a] + 1 < lines[b] or (lines[a] + 1 == lines[b] and further < error[b]):
                lines[b], error[b], before[b] = lines[a] + 1, further, a
    chosen = np.empty(lines[count - 1] + 1, np.int64)
    place = count - 1
    for i in range(len(chosen) - 1, -1, -1):
        chosen[i] = place
        place = before[place]
    return chosen


@kernel
def _squared_distance(moments, first, stop, x, y, u, v):
    """Sum over the points from `first` to `stop` of the squared distance from the line through (x, y) along
    (u, v)."""
    n = stop - first
    sum_x, sum_y = moments[stop, 0] - moments[first, 0], moments[stop, 1] - moments[first, 1]
    xx = moments[stop, 2] - moments[first, 2] - 2 * x * sum_x + n * x * x
    xy = moments[stop, 3] - moments[first, 3] - x * sum_y - y * sum_x + n * x * y
    yy = moments[stop, 4] - moments[first, 4] - 2 * y * sum_y + n * y * y
    return (v * v * xx - 2 * u * v * xy + u * u * yy) / (u * u + v * v)
