"""Colours of boundary unknowns, predicted along the curves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.colors import FRACTION, rounded
from gcvec.codec.integers import NODES, code_integer, sign, size_class
from gcvec.codec.mixing import Model, place_contexts
from gcvec.codec.prediction import FURTHEST, correction, learn, nearest_integer
from gcvec.codec.range_coder import Coder
from gcvec.kernels import bare_kernel, kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_FEATURES = 6
"""Of the linear model that predicts a colour."""

_SIZE_CONTEXTS, _SIGN_CONTEXTS, _CONTEXT_SIZE = 4, 2, 256
_AXIS_COUNTERS = (_SIZE_CONTEXTS + _SIGN_CONTEXTS) * _CONTEXT_SIZE * NODES
BOUNDARY_COUNTERS, BOUNDARY_ROWS, BOUNDARY_INPUTS = 3 * _AXIS_COUNTERS, 3 * NODES, _SIZE_CONTEXTS

_UNKNOWN_DIFFERENCE = 8
"""What a curve's colours are taken to differ by, in steps, before any of it is known. Like all numbers of the
coder it is part of the format: another makes other files."""


@kernel
def code_boundary_colors(
    coder: Coder,
    model: Model,
    unknowns: Ints,
    starts: Ints,
    patch: Ints,
    twin: Ints,
    n_patches: int,
    strides: Ints,
    first_stride: int,
    wanted: Floats,
    result: Ints,
) -> None:
    """Write the coordinates `wanted` `(b, 3)`, in steps, of boundary unknowns, or read them.

    Either way `result` `(b, 3)` becomes what a decoder sees, in sixteenths of a step. `unknowns` are those of
    all curve sides one after another, side s from `starts[s]` on, with `patch[s]` beside it; `twin[s]` is the
    other side of its curve if that came before, else -1; `strides` `(b,)` are what differences of each
    unknown count by, but at most by `first_stride` for the first of a patch. A colour is predicted by the one
    before along the curve, the first by the last one known at the same patch.
    """
    known, met = np.zeros(len(result), np.bool_), np.zeros(n_patches, np.bool_)
    last = np.zeros((n_patches, 3), np.int64)
    before, change, earlier = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3, np.int64)
    differences, differences_before = np.zeros(3, np.int64), np.zeros(3, np.int64)
    features, gain, power = np.zeros(_FEATURES), np.zeros((3, _FEATURES)), np.ones((3, _FEATURES))
    for side in range(len(starts) - 1):
        own = patch[side]
        before[:], change[:], earlier[:] = last[own], 0, 0
        differences_before[:] = _UNKNOWN_DIFFERENCE * strides[unknowns[starts[side]]]
        end = unknowns[starts[side + 1] - 1]
        for i in range(starts[side], starts[side + 1]):
            unknown, at = unknowns[i], i - starts[side]
            if not known[unknown]:
                place = min(at + 1, 3) if at > 0 else 1 if met[own] else 0
                stride = strides[unknown] if place > 0 else min(strides[unknown], first_stride)
                across = starts[twin[side]] + at if twin[side] >= 0 and at > 0 else 0
                for axis in range(3):
                    features[:] = 0.0
                    features[0] = change[axis] / FRACTION
                    features[1] = earlier[axis] / FRACTION
                    toward = result[end, axis] - before[axis] if known[end] else 0
                    features[2] = toward / FRACTION / (starts[side + 1] - i)
                    other = 0
                    if across > 0:
                        other = result[unknowns[across], axis] - result[unknowns[across - 1], axis]
                    features[3] = other / FRACTION
                    for b in range(axis):
                        features[4 + b] = differences[b] / FRACTION
                    prediction = before[axis] + nearest_integer(correction(gain[axis], features) * FRACTION)
                    turn = 3 * sign(before[axis] + change[axis] - prediction) + sign(other)
                    _choose_contexts(model, axis, place, own, stride, differences, differences_before, turn)
                    missing = (FRACTION * wanted[unknown, axis] - prediction) / stride
                    offer = rounded(missing, abs(differences_before[axis]) / stride)
                    difference = code_integer(
                        coder, model, _SIZE_CONTEXTS, _SIGN_CONTEXTS, axis * NODES, offer
                    )
                    differences[axis] = stride * difference
                    learn(gain[axis], power[axis], features, differences[axis] / FRACTION)
                    result[unknown, axis] = min(max(prediction + differences[axis], -FURTHEST), FURTHEST)
                differences_before[:] = differences
                known[unknown] = True
            met[own] = True
            if at > 0:
                earlier[:] = change
                change[:] = result[unknown] - before
            before[:] = result[unknown]
        last[own] = before


@bare_kernel
def _choose_contexts(
    model: Model,
    axis: int,
    place: int,
    patch: int,
    stride: int,
    differences: Ints,
    differences_before: Ints,
    turn: int,
) -> None:
    """Choose the contexts of one coordinate: four for the size of its difference, two for the sign.

    `differences` are those on the axes before, `differences_before` those of the colour before; what counts
    is how many times the `stride` they are.
    """
    sizes, signs = 0, 0
    for b in range(axis):
        sizes = abs(differences[b]) // stride + sizes // 2
        signs += (3 if b == 0 else 1) * sign(differences[b])
    sizes = min(size_class(sizes), 11)
    whole = 0
    for b in range(3):
        whole += abs(differences_before[b]) // stride
    slots = model.slots
    slots[0] = min(size_class(2 * (abs(differences_before[axis]) // stride)), 15) * 4 + place
    slots[1] = min(size_class(whole), 15) * 12 + sizes
    slots[2] = sizes * 4 + place
    slots[3] = min(patch, 63) * 4 + place
    slots[4] = signs * 3 + sign(differences_before[axis])
    slots[5] = turn
    last = _SIZE_CONTEXTS + _SIGN_CONTEXTS
    place_contexts(model, axis * _AXIS_COUNTERS, 0, last, _CONTEXT_SIZE, NODES)
