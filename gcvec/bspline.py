"""Cubic B-splines with uniform knots (paper, equations (3) to (5)).

A curve of m segments runs over u in [0, m]. An open one is clamped (knots 0,0,0,0,1,...,m,m,m,m; m + 3
control points, the first and last interpolated); a closed one is periodic (m control points, C2 everywhere).
Every function works on the local form of the basis: the index of the first of the four control points that
matter at u, and their four weights.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float64]

RUN = 4
"""Samples either way over which a curve's deviation from them is averaged."""

SHARE = 0.25
"""That mean may be so much of what a single sample may be off."""


@njit(cache=True, nogil=True)
def _knot(i: int, m: int, closed: bool) -> float:
    k = i - 3
    if closed:
        return float(k)
    return float(min(max(k, 0), m))


@njit(cache=True, nogil=True)
def spline_weights(u, m, closed, out):
    """Cox-de Boor at one parameter; returns the segment, fills the four weights."""
    segment = min(max(int(np.floor(u)), 0), m - 1)
    left = np.empty(4)
    right = np.empty(4)
    out[0] = 1.0
    for j in range(1, 4):
        left[j] = u - _knot(segment + 4 - j, m, closed)
        right[j] = _knot(segment + 3 + j, m, closed) - u
        saved = 0.0
        for r in range(j):
            ratio = out[r] / (right[r + 1] + left[j - r])
            out[r] = saved + right[r + 1] * ratio
            saved = left[j - r] * ratio
        out[j] = saved
    return segment


@njit(cache=True, nogil=True)
def _basis(u, m, closed):
    n_control = m if closed else m + 3
    index = np.empty((len(u), 4), np.int64)
    weight = np.empty((len(u), 4))
    for j in range(len(u)):
        segment = spline_weights(u[j], m, closed, weight[j])
        for k in range(4):
            index[j, k] = (segment + k) % n_control
    return index, weight


@njit(cache=True, nogil=True)
def _evaluate(control, index, weight):
    out = np.zeros((len(index), control.shape[1]))
    for j in range(len(index)):
        for k in range(4):
            for c in range(control.shape[1]):
                out[j, c] += weight[j, k] * control[index[j, k], c]
    return out


def basis(u: Floats, segments: int, closed: bool = False) -> tuple[NDArray[np.int64], Floats]:
    """Indices and weights, each `(n, 4)`, of the control points that make up the curve at parameters `u`."""
    index, weight = _basis(np.ascontiguousarray(u, np.float64), segments, closed)
    return index, weight


def segments_of(control: Floats, closed: bool) -> int:
    """Number of segments of the curve with these control points."""
    return len(control) if closed else len(control) - 3


def evaluate(control: Floats, u: Floats, closed: bool = False) -> Floats:
    """Points `(n, d)` of the curve with control points `(k, d)` at parameters `u`."""
    index, weight = basis(u, segments_of(control, closed), closed)
    points: Floats = _evaluate(np.ascontiguousarray(control, np.float64), index, weight)
    return points


@njit(cache=True, nogil=True)
def _chord_length(samples, m):
    u = np.zeros(len(samples))
    for j in range(1, len(samples)):
        dx = samples[j, 0] - samples[j - 1, 0]
        dy = samples[j, 1] - samples[j - 1, 1]
        u[j] = u[j - 1] + np.sqrt(dx * dx + dy * dy)
    if u[-1] > 0:
        u *= m / u[-1]
    return u


@njit(cache=True, nogil=True)
def _lspia(samples, importance, index, weight, control, n_fixed_ends, iterations, tolerance):
    """LSPIA sweeps in place: each control point moves by the weighted mean of its samples' residuals, eq.
    (4), (5), where a sample counts by its importance too.

    Stops early once no control point moves by more than `tolerance`. The column sums of the basis bound the
    step, which is
    what makes the iteration converge to the least-squares fit (Deng and Lin 2014).
    """
    n_control, d = control.shape
    mass = np.zeros(n_control)
    for j in range(len(samples)):
        for k in range(4):
            mass[index[j, k]] += importance[j] * weight[j, k]
    shift = np.empty((n_control, d))
    residual = np.empty(d)
    for _ in range(iterations):
        shift[:] = 0.0
        for j in range(len(samples)):
            for c in range(d):
                residual[c] = samples[j, c]
                for k in range(4):
                    residual[c] -= weight[j, k] * control[index[j, k], c]
            for k in range(4):
                for c in range(d):
                    shift[index[j, k], c] += importance[j] * weight[j, k] * residual[c]
        largest = 0.0
        for i in range(n_fixed_ends, n_control - n_fixed_ends):
            if mass[i] > 0:
                for c in range(d):
                    step = shift[i, c] / mass[i]
                    control[i, c] += step
                    largest = max(largest, abs(step))
        if largest < tolerance:
            break


@njit(cache=True, nogil=True)
def _initial_polygon(samples: Floats, u: Floats, m: int, closed: bool) -> Floats:
    """Samples at the Greville abscissae: where each control point has most weight."""
    n_control = m if closed else m + 3
    control = np.empty((n_control, samples.shape[1]))
    for i in range(n_control):
        if closed:
            g = float((i - 1) % m)
        else:
            g = (_knot(i + 1, m, False) + _knot(i + 2, m, False) + _knot(i + 3, m, False)) / 3.0
        j = min(max(int(np.searchsorted(u, g)), 1), len(u) - 1)
        span = u[j] - u[j - 1]
        t = (g - u[j - 1]) / span if span > 0 else 0.0
        control[i] = (1 - t) * samples[j - 1] + t * samples[j]
    return control


@njit(cache=True, nogil=True)
def _fit(samples, distances, m, closed, iterations, tolerance):
    """Control points, and the largest deviation as a share of what is allowed there: the distance from one
    sample, or the mean over a run of samples, of which less is allowed because noise has no part in it."""
    u = _chord_length(samples, float(m))
    control = _initial_polygon(samples, u, m, closed)
    index, weight = _basis(u, m, closed)
    importance = distances.min() ** 2 / distances**2
    _lspia(samples, importance, index, weight, control, 0 if closed else 1, iterations, tolerance)
    if not closed:
        control[0] = samples[0]
        control[-1] = samples[-1]
    deviation = 0.0
    residual = _evaluate(control, index, weight) - samples
    for j in range(len(samples)):
        first, end = max(j - RUN, 0), min(j + RUN + 1, len(samples))
        single, mean = 0.0, 0.0
        for c in range(samples.shape[1]):
            single += residual[j, c] ** 2
            mean += residual[first:end, c].mean() ** 2
        deviation = max(deviation, max(single, mean / SHARE**2) / distances[j] ** 2)
    return control, np.sqrt(deviation)


@njit(cache=True, nogil=True)
def _fit_within(samples, distances, m, largest_m, closed):
    while True:
        control, deviation = _fit(samples, distances, m, closed, 40, 1e-3)
        if deviation <= 1 or m >= largest_m:
            return control
        m = min(max(m + 1, (5 * m) // 4), largest_m)


def fit(samples: Floats, segments: int, closed: bool = False, iterations: int = 1000) -> Floats:
    """Control points of the least-squares curve through `samples` by PIA, equations (4) and (5).

    `samples` is `(n, d)` in order, chord-length parametrised; an open curve interpolates its first and last
    sample, a closed one expects the first sample repeated at the end.
    """
    exact = np.ascontiguousarray(samples, np.float64)
    control, _ = _fit(exact, np.ones(len(exact)), segments, closed, iterations, 1e-12)
    return np.asarray(control)


def fit_within(samples: Floats, distances: Floats | float, segments: int = 1, closed: bool = False) -> Floats:
    """Control points of a curve with few segments, at least `segments`, that stays within `distances` of the
    samples: one for all of them, or `(n,)`, one for each, by whose inverse squares samples count.

    Where even a curve with as many segments as samples does not come that close, that curve is returned.
    """
    fewest = 3 if closed else 1
    most = max(len(samples) - 1, fewest)
    start = min(max(segments, fewest), most)
    exact = np.ascontiguousarray(samples, np.float64)
    allowed = np.ascontiguousarray(np.broadcast_to(distances, len(exact)), np.float64)
    return np.asarray(_fit_within(exact, allowed, start, most, closed))


@njit(cache=True, nogil=True)
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
                a, b = _knot(segment + k + level, m, closed), _knot(segment + k + 4, m, closed)
                t = (x - a) / (b - a)
                local[k] = (1 - t) * local[k] + t * local[k + 1]
        out[c] = local[0]


@njit(cache=True, nogil=True)
def _refine(control, closed):
    m = len(control) if closed else len(control) - 3
    n = 2 * m if closed else 2 * m + 3
    out = np.empty((n, control.shape[1]))
    for i in range(n):
        u, v, w = _knot(i + 1, 2 * m, closed), _knot(i + 2, 2 * m, closed), _knot(i + 3, 2 * m, closed)
        _blossom(control, u / 2, v / 2, w / 2, closed, out[i])
    return out


@njit(cache=True, nogil=True)
def spline_bezier(control, closed, out):
    """Fill `(m, 4, d)` with the Bézier control points of the m segments."""
    for s in range(len(out)):
        a, b = float(s), float(s + 1)
        _blossom(control, a, a, a, closed, out[s, 0])
        _blossom(control, a, a, b, closed, out[s, 1])
        _blossom(control, a, b, b, closed, out[s, 2])
        _blossom(control, b, b, b, closed, out[s, 3])


def refine(control: Floats, closed: bool = False) -> Floats:
    """The same curve with every segment cut in half by knot insertion (Boehm); u doubles.

    Exact: `evaluate(refine(P), 2 u) == evaluate(P, u)`. The new control points are values of the curve's
    blossom at
    triples of new knots (Ramshaw 1989).
    """
    return np.asarray(_refine(np.ascontiguousarray(control, np.float64), closed))


def bezier(control: Floats, closed: bool = False) -> Floats:
    """Bézier control points `(m, 4, d)` of the m segments, the exact conversion by knot insertion."""
    out = np.empty((segments_of(control, closed), 4, control.shape[1]))
    spline_bezier(np.ascontiguousarray(control, np.float64), closed, out)
    return out
