"""Nodes and control points of boundary curves, on the file's grid."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.integers import NODES, code_integer, sign, size_class
from gcvec.codec.mixing import Model, place_contexts
from gcvec.codec.prediction import correction, learn, nearest_integer
from gcvec.codec.range_coder import Coder
from gcvec.codec.topology import END, START
from gcvec.kernels import bare_kernel, kernel

Ints = NDArray[np.int64]

_CONTEXTS, _CONTEXT_SIZE = 5, 256
_COORDINATES = 4
"""Kinds of coordinates: x and y of nodes, x and y of other control points."""

GEOMETRY_COUNTERS = _COORDINATES * _CONTEXTS * _CONTEXT_SIZE * NODES
GEOMETRY_ROWS, GEOMETRY_INPUTS = _COORDINATES * NODES, 3

_FEATURES = 4
_SCALE = 8.0
"""Grid steps in a unit of the features of a prediction."""

_ONWARD, _HOMEWARD = 0.6, 0.4
"""Shares of the stride before and of the straight way to the end in the next one: a curve has to arrive."""


@bare_kernel
def _code_coordinate(
    coder: Coder, model: Model, kind: int, sizes: tuple[int, int], signs: tuple[int, int], value: int
) -> int:
    """Code an integer under none and two contexts for its size, and two for its sign."""
    slots = model.slots
    slots[0] = 0
    slots[1], slots[2] = sizes
    slots[3], slots[4] = signs
    place_contexts(model, kind * _CONTEXTS * _CONTEXT_SIZE * NODES, 0, _CONTEXTS, _CONTEXT_SIZE, NODES)
    coded: int = code_integer(coder, model, 3, 2, kind * NODES, value)
    return coded


@kernel
def code_geometry(coder: Coder, model: Model, table: Ints, offsets: Ints, nodes: Ints, control: Ints) -> None:
    """Write node positions `(k, 2)` and control points `(n, 2)` in grid steps, or read them.

    Curve c has its inner control points (all, when it is closed) in `control[offsets[c]:offsets[c + 1]]`.
    Each is predicted to go on as the curve did, bent towards the end of the curve, and corrected by a linear
    model that learns.
    """
    known = np.zeros(len(nodes), np.bool_)
    features, gain, power = np.zeros(_FEATURES), np.zeros((2, _FEATURES)), np.ones((2, _FEATURES))
    last, stride, earlier = np.zeros(2, np.int64), np.zeros(2, np.int64), np.zeros(2, np.int64)
    missed, missed_before = np.zeros(2, np.int64), np.zeros(2, np.int64)
    for c in range(len(table)):
        start, end = table[c, START], table[c, END]
        for node in (start, end):
            if node >= 0 and not known[node]:
                away = 0
                for axis in range(2):
                    offer = nodes[node, axis] - last[axis]
                    moved = _code_coordinate(coder, model, axis, (0, away), (0, 0), offer)
                    nodes[node, axis] = last[axis] + moved
                    away = 1 + size_class(abs(moved))
                known[node] = True
            if node >= 0:
                last[:] = nodes[node]
        if start >= 0:
            last[:] = nodes[start]
        stride[:], earlier[:], missed_before[:] = 0, 0, 8
        surprise = 16
        count = offsets[c + 1] - offsets[c]
        for i in range(count):
            k = offsets[c] + i
            place = min(i, 3) if start >= 0 else 4 + min(i, 3)
            size = min(size_class(abs(missed_before[0]) + abs(missed_before[1])), 15)
            for axis in range(2):
                ahead = float(stride[axis])
                features[:] = 0.0
                if start >= 0:
                    toward = (nodes[end, axis] - last[axis]) / (count - i + 1)
                    ahead = toward if i == 0 else _ONWARD * ahead + _HOMEWARD * toward
                    features[0] = (toward - ahead) / _SCALE
                if i > 0:
                    features[1] = earlier[axis] / _SCALE
                    features[2] = missed_before[axis] / _SCALE
                across, turn = 0, 0
                if axis == 1:
                    features[3] = missed[0] / _SCALE
                    across = min(size_class(abs(missed[0])), 15)
                    turn = 3 * sign(missed[0]) + sign(missed_before[0])
                guess = last[axis] + nearest_integer(ahead + _SCALE * correction(gain[axis], features))
                sizes = min(size_class(surprise), 27) * 8 + place, across * 16 + size
                signs = 9 * sign(missed_before[axis]) + turn, 3 * sign(stride[axis]) + sign(earlier[axis])
                missed[axis] = _code_coordinate(
                    coder, model, 2 + axis, sizes, signs, control[k, axis] - guess
                )
                control[k, axis] = guess + missed[axis]
                learn(gain[axis], power[axis], features, missed[axis] / _SCALE)
            surprise = (surprise + abs(missed[0]) + abs(missed[1])) >> 1
            missed_before[:] = missed
            earlier[:] = stride
            stride[:] = control[k] - last
            last[:] = control[k]
