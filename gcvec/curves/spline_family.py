"""Many cubic B-splines at once: what all curves of a picture have to do with their control points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.bspline import spline_bezier, spline_weights
from gcvec.kernels import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class SplineFamily:
    """How the control points of c curves, one curve after another, belong to them.

    offsets  (c + 1,) where each curve's control points begin
    closed   (c,) bool, the periodic curves
    """

    offsets: Ints
    closed: NDArray[np.bool_]

    @cached_property
    def segments(self) -> Ints:
        """`(c,)` number of segments of each curve."""
        return np.asarray(np.diff(self.offsets) - 3 * ~self.closed)

    @cached_property
    def first_segment(self) -> Ints:
        """`(c + 1,)` where each curve's segments begin, counted through all curves."""
        return np.concatenate([[0], np.cumsum(self.segments)])

    def basis(self, curve: Ints, u: Floats) -> tuple[Ints, Floats]:
        """Control points `(n, 4)`, counted through all curves, and their weights, that make up the points at
        the parameters `u` `(n,)` of the curves `curve` `(n,)`."""
        index, weight = _basis(curve, np.ascontiguousarray(u, np.float64), self.offsets, self.closed)
        return index, weight

    def bezier(self, control_points: Floats) -> Floats:
        """Bézier control points `(s, 4, d)` of the segments of all curves with control points `(k, d)`."""
        return np.asarray(_bezier(np.ascontiguousarray(control_points), self.offsets, self.closed))

    def bend(self, control_points: Floats) -> Floats:
        """`(s,)` the largest |C''| on each segment: it is linear there, so one end has it."""
        corners = self.bezier(control_points)
        ends = corners[:, :2] - 2 * corners[:, 1:3] + corners[:, 2:]
        return np.asarray(6 * np.hypot(ends[..., 0], ends[..., 1]).max(axis=1))


@kernel
def _basis(curve, u, offsets, closed):
    index = np.empty((len(u), 4), np.int64)
    weight = np.empty((len(u), 4))
    for j in range(len(u)):
        c = curve[j]
        first, n = offsets[c], offsets[c + 1] - offsets[c]
        segment = spline_weights(u[j], n if closed[c] else n - 3, closed[c], weight[j])
        for k in range(4):
            index[j, k] = first + (segment + k) % n
    return index, weight


@kernel
def _bezier(control_points, offsets, closed):
    n = 0
    for c in range(len(closed)):
        n += offsets[c + 1] - offsets[c] - (0 if closed[c] else 3)
    out = np.empty((n, 4, control_points.shape[1]))
    s = 0
    for c in range(len(closed)):
        m = offsets[c + 1] - offsets[c] - (0 if closed[c] else 3)
        spline_bezier(control_points[offsets[c] : offsets[c + 1]], closed[c], out[s : s + m])
        s += m
    return out
