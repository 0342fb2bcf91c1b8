"""Cubic B-splines with uniform knots (paper, equation (3)).

A curve of m segments runs over u in [0, m]. An open one is clamped (knots 0,0,0,0,1,...,m,m,m,m; m + 3
control points, the first and last interpolated); a closed one is periodic (m control points, C2 everywhere).
Every function works on the local form of the basis: the index of the first of the four control points that
matter at u, and their four weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel

Floats = NDArray[np.float64]


@kernel
def knot(i: int, m: int, closed: bool) -> float:
    k = i - 3
    if closed:
        return float(k)
    return float(min(max(k, 0), m))


@kernel
def spline_weights(u, m, closed, out):
    """Cox-de Boor at one parameter; returns the segment, fills the four weights."""
    segment = min(max(int(np.floor(u)), 0), m - 1)
    left = np.empty(4)
    right = np.empty(4)
    out[0] = 1.0
    for j in range(1, 4):
        left[j] = u - knot(segment + 4 - j, m, closed)
        right[j] = knot(segment + 3 + j, m, closed) - u
        saved = 0.0
        for r in range(j):
            ratio = out[r] / (right[r + 1] + left[j - r])
            out[r] = saved + right[r + 1] * ratio
            saved = left[j - r] * ratio
        out[j] = saved
    return segment


@kernel
def spline_basis(u, m, closed):
    n_control = m if closed else m + 3
    index = np.empty((len(u), 4), np.int64)
    weight = np.empty((len(u), 4))
    for j in range(len(u)):
        segment = spline_weights(u[j], m, closed, weight[j])
        for k in range(4):
            index[j, k] = (segment + k) % n_control
    return index, weight


@kernel
def _evaluate(control, index, weight):
    out = np.zeros((len(index), control.shape[1]))
    for j in range(len(index)):
        for k in range(4):
            for c in range(control.shape[1]):
                out[j, c] += weight[j, k] * control[index[j, k], c]
    return out


def basis(u: Floats, segments: int, closed: bool = False) -> tuple[NDArray[np.int64], Floats]:
    """Indices and weights, each `(n, 4)`, of the control points that make up the curve at parameters `u`."""
    index, weight = spline_basis(np.ascontiguousarray(u, np.float64), segments, closed)
    return index, weight


def segments_of(control: Floats, closed: bool) -> int:
    """Number of segments of the curve with these control points."""
    return len(control) if closed else len(control) - 3


def evaluate(control: Floats, u: Floats, closed: bool = False) -> Floats:
    """Points `(n, d)` of the curve with control points `(k, d)` at parameters `u`."""
    index, weight = basis(u, segments_of(control, closed), closed)
    points: Floats = _evaluate(np.ascontiguousarray(control, np.float64), index, weight)
    return points


@kernel
def _blossom(control: Floats, u: float, v: float, w: float, closed: bool, out: Floats) -> None:
    m = len(control) if closed else len(control) - 3
    mean = (u + v + w) / 3
    if closed and mean < 0:
        u, v, w, mean = u + m, v + m, w + m, mean + m
    segment = min(max(int(np.floor(mean)), 0), m - 1)
    local = np.empty(4)
    for c in range(control.shape[1]):
        for k in range(4):
            local[k] = control[(segment + k) % len(control), c]
        for level in range(1, 4):
            x = u if level == 1 else v if level == 2 else w
            for k in range(4 - level):
                a, b = knot(segment + k + level, m, closed), knot(segment + k + 4, m, closed)
                t = (x - a) / (b - a)
                local[k] = (1 - t) * local[k] + t * local[k + 1]
        out[c] = local[0]


@kernel
def spline_bezier(control, closed, out):
    """Fill `(m, 4, d)` with the Bézier control points of the m segments."""
    for s in range(len(out)):
        a, b = float(s), float(s + 1)
        _blossom(control, a, a, a, closed, out[s, 0])
        _blossom(control, a, a, b, closed, out[s, 1])
        _blossom(control, a, b, b, closed, out[s, 2])
        _blossom(control, b, b, b, closed, out[s, 3])


def bezier(control: Floats, closed: bool = False) -> Floats:
    """Bézier control points `(m, 4, d)` of the m segments, the exact conversion by knot insertion."""
    out = np.empty((segments_of(control, closed), 4, control.shape[1]))
    spline_bezier(np.ascontiguousarray(control, np.float64), closed, out)
    return out
