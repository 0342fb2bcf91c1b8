"""A straight line through samples of a border."""

from __future__ import annotations

import numpy as np

from gcvec.kernels import kernel


@kernel
def fit_line(points, direction, middle):
    """The line through points `(k, 2)`: fills its direction and a point on it; returns the squared distances
    left."""
    k = len(points)
    middle[0], middle[1] = points[:, 0].mean(), points[:, 1].mean()
    xx, xy, yy = 0.0, 0.0, 0.0
    for i in range(k):
        x, y = points[i, 0] - middle[0], points[i, 1] - middle[1]
        xx += x * x
        xy += x * y
        yy += y * y
    angle = np.arctan2(2 * xy, xx - yy) / 2
    dx, dy = np.cos(angle), np.sin(angle)
    if dx * (points[k - 1, 0] - points[0, 0]) + dy * (points[k - 1, 1] - points[0, 1]) < 0:
        dx, dy = -dx, -dy
    direction[0], direction[1] = dx, dy
    return max((xx + yy - np.hypot(xx - yy, 2 * xy)) / 2, 0.0)
