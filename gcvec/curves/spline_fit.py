"""Cubic B-splines through samples: progressive iterative approximation (paper, equations (4) and (5)).

Many curves are fitted at once. Their samples are laid end to end; curve k owns those from `starts[k]` to
`starts[k + 1]`, a closed one repeats its first sample at the end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.bspline import knot, spline_basis
from gcvec.kernels import kernel
from gcvec.parallel import in_shares

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RUN = 4
"""Samples either way over which a curve's deviation from them is averaged."""

SHARE = 0.25
"""That mean may be so much of what a single sample may be off."""

SWEEPS, STILL = 40, 1e-3
"""So many sweeps are enough to tell whether a curve comes close to its samples, fewer once no control point
moves further than this, pixels."""


@kernel
def _chord_length(samples, m):
    u = np.zeros(len(samples))
    for j in range(1, len(samples)):
        dx = samples[j, 0] - samples[j - 1, 0]
        dy = samples[j, 1] - samples[j - 1, 1]
        u[j] = u[j - 1] + np.sqrt(dx * dx + dy * dy)
    if u[-1] > 0:
        u *= m / u[-1]
    return u


@kernel
def _gram(samples, importance, index, weight, n_control):
    """BᵀW B as its seven diagonals `(n_control, 7)`, BᵀW s, and the column sums of BᵀW."""
    gram = np.zeros((n_control, 7))
    right = np.zeros((n_control, 2))
    mass = np.zeros(n_control)
    for j in range(len(samples)):
        for a in range(4):
            i, share = index[j, a], importance[j] * weight[j, a]
            mass[i] += share
            right[i, 0] += share * samples[j, 0]
            right[i, 1] += share * samples[j, 1]
            for b in range(4):
                gram[i, b - a + 3] += share * weight[j, b]
    return gram, right, mass


@kernel
def _lspia(gram, right, mass, control, closed, sweeps, still):
    """LSPIA in place: each control point moves by the weighted mean of its samples' residuals, eq. (4), (5).

    Those means are (BᵀW s - BᵀW B P) / BᵀW 1. Stops early once no control point moves by more than `still`.
    The column sums of the basis bound the step, which is what makes the iteration converge to the
    least-squares fit (Deng and Lin 2014). The ends of open curves stay.
    """
    n = len(control)
    fixed = 0 if closed else 1
    shift = np.zeros((n, 2))
    for _ in range(sweeps):
        largest = 0.0
        for i in range(fixed, n - fixed):
            if mass[i] == 0:
                continue
            x, y = right[i, 0], right[i, 1]
            for k in range(7):
                # On open curves the entries that would run over the ends are 0.
                j = i + k - 3
                j = j + n if j < 0 else j - n if j >= n else j
                j = j % n
                x -= gram[i, k] * control[j, 0]
                y -= gram[i, k] * control[j, 1]
            shift[i, 0], shift[i, 1] = x / mass[i], y / mass[i]
            largest = max(largest, abs(shift[i, 0]), abs(shift[i, 1]))
        control += shift
        if largest < still:
            break


@kernel
def _initial_polygon(samples, u, m, closed):
    """Samples at the Greville abscissae: where each control point has most weight."""
    n_control = m if closed else m + 3
    control = np.empty((n_control, 2))
    for i in range(n_control):
        if closed:
            g = float((i - 1) % m)
        else:
            g = (knot(i + 1, m, False) + knot(i + 2, m, False) + knot(i + 3, m, False)) / 3.0
        j = min(max(int(np.searchsorted(u, g)), 1), len(u) - 1)
        span = u[j] - u[j - 1]
        t = (g - u[j - 1]) / span if span > 0 else 0.0
        for c in range(2):
            control[i, c] = (1 - t) * samples[j - 1, c] + t * samples[j, c]
    return control


@kernel
def _deviation(samples, distances, control, index, weight):
    """The largest deviation as a share of what is allowed there: the distance from one sample, or the mean
    over a run of samples, of which less is allowed because noise has no part in it."""
    n = len(samples)
    off = np.zeros((n, 2))
    summed = np.zeros((n + 1, 2))
    for j in range(n):
        for c in range(2):
            off[j, c] = -samples[j, c]
            for k in range(4):
                off[j, c] += weight[j, k] * control[index[j, k], c]
            summed[j + 1, c] = summed[j, c] + off[j, c]
    largest = 0.0
    for j in range(n):
        first, end = max(j - RUN, 0), min(j + RUN + 1, n)
        x = (summed[end, 0] - summed[first, 0]) / (end - first)
        y = (summed[end, 1] - summed[first, 1]) / (end - first)
        single, mean = off[j, 0] ** 2 + off[j, 1] ** 2, x * x + y * y
        largest = max(largest, max(single, mean / SHARE**2) / distances[j] ** 2)
    return np.sqrt(largest)


@kernel
def fit_spline(samples, distances, m, closed, sweeps, still):
    """Control points `(k, 2)` of a curve of m segments through samples `(n, 2)` after so many sweeps, and its
    largest deviation as a share of `distances` `(n,)`.

    Samples are parametrised by chord length. An open curve interpolates its first and last one.
    """
    u = _chord_length(samples, float(m))
    control = _initial_polygon(samples, u, m, closed)
    index, weight = spline_basis(u, m, closed)
    importance = distances.min() ** 2 / distances**2
    gram, right, mass = _gram(samples, importance, index, weight, len(control))
    if not closed:
        control[0] = samples[0]
        control[-1] = samples[-1]
    _lspia(gram, right, mass, control, closed, sweeps, still)
    return control, _deviation(samples, distances, control, index, weight)


@kernel
def _fit_within(samples, distances, m, largest_m, closed):
    while True:
        control, deviation = fit_spline(samples, distances, m, closed, SWEEPS, STILL)
        if deviation <= 1 or m >= largest_m:
            return control
        m = min(max(m + 1, (5 * m) // 4), largest_m)


@kernel
def _fit_all_within(samples, starts, distances, fewest, most, closed, first, last):
    """Control points of the curves `first` to `last`, one curve after another, and how many each has."""
    room = 0
    for k in range(first, last):
        room += most[k] + 3
    control = np.empty((room, 2))
    counts = np.empty(last - first, np.int64)
    n = 0
    for k in range(first, last):
        a, b = starts[k], starts[k + 1]
        own = _fit_within(samples[a:b], distances[a:b], fewest[k], most[k], closed[k])
        control[n : n + len(own)] = own
        counts[k - first] = len(own)
        n += len(own)
    return control[:n], counts


def fit_all_within(
    samples: Floats, starts: Ints, distances: Floats, segments: Ints, closed: NDArray[np.bool_]
) -> list[Floats]:
    """Control points `(k, 2)` of every curve: with few segments, at least `segments` `(c,)`, within
    `distances` `(n,)` of its samples `(n, 2)`, by whose inverse squares samples count.

    Where even a curve with as many segments as samples does not come that close, that curve is returned.
    """
    fewest = np.where(closed, 3, 1)
    most = np.maximum(np.diff(starts) - 1, fewest)
    start = np.clip(segments, fewest, most)
    shares = in_shares(
        lambda first, last: _fit_all_within(samples, starts, distances, start, most, closed, first, last),
        len(closed),
    )
    control = np.concatenate([own for own, _ in shares])
    counts = np.concatenate([own for _, own in shares])
    return np.split(control, np.cumsum(counts)[:-1])
