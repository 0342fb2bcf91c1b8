"""Colours as small integers: differences from a prediction, in a decorrelated basis, in steps.

A difference from the prediction is taken apart into lightness and two chroma axes. The basis is orthonormal,
so equal steps are what mean squared error over R, G and B asks for. Prediction uses colours as a decoder
knows them.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcvec.entropy import INTEGER_CONTEXTS, Coder, code_integer

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

BASIS = np.array([[1.0, 1.0, 1.0], [1.0, 0.0, -1.0], [1.0, -2.0, 1.0]])
BASIS /= np.linalg.norm(BASIS, axis=1)[:, None]

DEAD_ZONE = 0.1
"""Differences are rounded towards zero by this share of a step more than to nearest: it saves more than it
costs."""

COLOR_CONTEXTS = 3 * 3 * INTEGER_CONTEXTS

_REACH = 6
_NEIGHBORS = 6
_BASE_DISTANCE = 12.0


@njit(cache=True, nogil=True)
def code_color(
    coder: Coder, context: int, activity: int, prediction: Floats, color: Floats, step: float, basis: Floats
) -> int:
    """Write `color` `(3,)` as steps from `prediction`, or read it; either way it becomes what a decoder sees.

    `activity` is the size of differences nearby; it chooses the model. Returns the size of this difference.
    """
    level = 0 if activity < 2 else 1 if activity < 5 else 2
    size = 0
    steps = np.zeros(3)
    for axis in range(3):
        along = 0.0
        for c in range(3):
            along += basis[axis, c] * (color[c] - prediction[c])
        whole = int(np.floor(abs(along) / step + 0.5 - DEAD_ZONE))
        if along < 0:
            whole = -whole
        whole = code_integer(coder, context + (3 * axis + level) * INTEGER_CONTEXTS, whole)
        steps[axis] = whole * step
        size += abs(whole)
    for c in range(3):
        color[c] = prediction[c]
        for axis in range(3):
            color[c] += basis[axis, c] * steps[axis]
    return size


@njit(cache=True, nogil=True)
def code_boundary_colors(
    coder: Coder,
    context: int,
    unknowns: Ints,
    starts: Ints,
    patch: Ints,
    n_patches: int,
    colors: Floats,
    step: float,
    basis: Floats,
) -> None:
    """Write the colours of boundary unknowns `(n, 3)`, or read them, curve side by curve side.

    `unknowns` are those of all curve sides one after another, side s from `starts[s]` on, with `patch[s]`
    beside it. A colour is
    predicted by the one before along the curve, the first by the last one known at the same patch.
    """
    known = np.zeros(len(colors), np.bool_)
    last = np.full((n_patches, 3), 0.5)
    for side in range(len(starts) - 1):
        before = last[patch[side]].copy()
        activity = 8
        for i in range(starts[side], starts[side + 1]):
            unknown = unknowns[i]
            if not known[unknown]:
                activity = code_color(coder, context, activity, before, colors[unknown], step, basis)
                known[unknown] = True
            before[:] = colors[unknown]
        last[patch[side]] = before


@njit(cache=True, nogil=True)
def code_point_colors(
    coder: Coder,
    context: int,
    order: Ints,
    points: Ints,
    patch: Ints,
    base: Floats,
    colors: Floats,
    width: int,
    height: int,
    step: float,
    basis: Floats,
) -> None:
    """Write the colours of interior control points `(n, 3)`, or read them, in the given order.

    A point is predicted by `base` `(n, 3)`, what the boundary alone gives there, plus what the known points
    of its patch
    nearby differ from theirs, weighted by inverse square distance.
    """
    cell = 8
    columns, rows = width // cell + 1, height // cell + 1
    head = np.full((rows, columns), -1, np.int64)
    following = np.full(len(points), -1, np.int64)
    activity = np.zeros(len(points), np.int64)
    prediction = np.empty(3)
    near = np.empty(_NEIGHBORS, np.int64)
    near_square = np.empty(_NEIGHBORS)
    for i in order:
        x, y = points[i, 0], points[i, 1]
        cx, cy = x // cell, y // cell
        n = 0
        for ring in range(_REACH):
            if n == _NEIGHBORS and near_square[n - 1] <= ((ring - 1) * cell) ** 2:
                break
            for gy in range(max(cy - ring, 0), min(cy + ring + 1, rows)):
                edge = gy == cy - ring or gy == cy + ring
                for gx in range(max(cx - ring, 0), min(cx + ring + 1, columns)):
                    if not edge and gx != cx - ring and gx != cx + ring:
                        continue
                    j = head[gy, gx]
                    while j >= 0:
                        if patch[j] == patch[i]:
                            square = float((points[j, 0] - x) ** 2 + (points[j, 1] - y) ** 2)
                            if n < _NEIGHBORS or square < near_square[n - 1]:
                                k = n if n < _NEIGHBORS else n - 1
                                n = min(n + 1, _NEIGHBORS)
                                while k > 0 and near_square[k - 1] > square:
                                    near[k], near_square[k] = near[k - 1], near_square[k - 1]
                                    k -= 1
                                near[k], near_square[k] = j, square
                        j = following[j]
        total = 1.0 / _BASE_DISTANCE**2
        prediction[:] = 0.0
        seen = 0.0
        for k in range(n):
            weight = 1.0 / near_square[k]
            total += weight
            seen += weight * activity[near[k]]
            for c in range(3):
                prediction[c] += weight * (colors[near[k], c] - base[near[k], c])
        for c in range(3):
            prediction[c] = base[i, c] + prediction[c] / total
        around = int(seen / total + 0.5) if n else 8
        activity[i] = code_color(coder, context, around, prediction, colors[i], step, basis)
        following[i] = head[cy, cx]
        head[cy, cx] = i


def progressive_order(points: Ints) -> Ints:
    """An order of points that spreads them ever more densely: by a hash of the pixel, so that a decoder
    knows it."""
    x, y = points[:, 0].astype(np.uint64), points[:, 1].astype(np.uint64)
    mask = np.uint64(0xFFFFFFFF)
    h = (x * np.uint64(0x9E3779B1) + y * np.uint64(0x7FEB352D)) & mask
    h = ((h ^ (h >> np.uint64(16))) * np.uint64(0x21F0AAAD)) & mask
    h = ((h ^ (h >> np.uint64(15))) * np.uint64(0x735A2D97)) & mask
    return np.argsort(h ^ (h >> np.uint64(15)), kind="stable")
