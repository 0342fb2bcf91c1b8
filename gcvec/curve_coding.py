"""Topology and control points of boundary curves as entropy-coded integers."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcvec.entropy import INTEGER_CONTEXTS, SEQUENCE_CONTEXTS, Coder, code_bit, code_integer

Ints = NDArray[np.int64]

LEFT, RIGHT, START, END, LEVEL, SEGMENTS, HARD = range(7)
"""Columns of the table of curves."""

_FLAGS = 8
_NUMBERS = _FLAGS
_NODES = _NUMBERS + 6 * INTEGER_CONTEXTS
_INNER = _NODES + 2 * INTEGER_CONTEXTS
CURVE_CONTEXTS = _INNER + 2 * SEQUENCE_CONTEXTS


@njit(cache=True, nogil=True)
def code_topology(coder: Coder, context: int, table: Ints) -> None:
    """Write the table of curves `(c, 7)`, or read it. Nodes must be numbered in the order in which curves
    meet them.

    A curve often goes on where the last one, of the same border, ended at a corner.
    """
    numbers = context + _NUMBERS
    left, right, node, next_node = 0, 0, -1, 0
    for c in range(len(table)):
        goes_on = (
            table[c, START] == node and table[c, LEFT] == left and table[c, RIGHT] == right and node >= 0
        )
        goes_on = code_bit(coder, context, 1 if goes_on else 0) == 1
        if not goes_on:
            table[c, LEFT] = left + code_integer(coder, numbers, table[c, LEFT] - left)
            table[c, RIGHT] = right + code_integer(coder, numbers + INTEGER_CONTEXTS, table[c, RIGHT] - right)
            closed = code_bit(coder, context + 1, 1 if table[c, START] < 0 else 0)
            if closed:
                table[c, START] = table[c, END] = -1
            else:
                table[c, START] = _code_node(
                    coder, context + 2, numbers + 2 * INTEGER_CONTEXTS, table[c, START], next_node
                )
                next_node = max(next_node, table[c, START] + 1)
        else:
            table[c, LEFT], table[c, RIGHT], table[c, START] = left, right, node
        if table[c, START] >= 0:
            table[c, END] = _code_node(
                coder, context + 3, numbers + 3 * INTEGER_CONTEXTS, table[c, END], next_node
            )
            next_node = max(next_node, table[c, END] + 1)
        left, right, node = table[c, LEFT], table[c, RIGHT], table[c, END]
        table[c, LEVEL] = code_integer(coder, numbers + 4 * INTEGER_CONTEXTS, table[c, LEVEL])
        table[c, SEGMENTS] = code_integer(coder, numbers + 5 * INTEGER_CONTEXTS, table[c, SEGMENTS])
        table[c, HARD] = code_bit(coder, context + 4, table[c, HARD])


@njit(cache=True, nogil=True)
def _code_node(coder: Coder, flag: int, context: int, node: int, next_node: int) -> int:
    if code_bit(coder, flag, 1 if node == next_node else 0):
        return next_node
    return next_node - 1 - code_integer(coder, context, next_node - 1 - node)


@njit(cache=True, nogil=True)
def code_geometry(coder: Coder, context: int, table: Ints, offsets: Ints, nodes: Ints, control: Ints) -> None:
    """Write node positions `(k, 2)` and control points `(n, 2)` in grid steps, or read them.

    Curve c has its inner control points (all, when it is closed) in `control[offsets[c]:offsets[c + 1]]`.
    Each is predicted to go on as
    the curve did, bent towards the end of the curve.
    """
    known = np.zeros(len(nodes), np.bool_)
    last = np.zeros(2, np.int64)
    for c in range(len(table)):
        start, end = table[c, START], table[c, END]
        for node in (start, end):
            if node >= 0 and not known[node]:
                for axis in range(2):
                    model = context + _NODES + axis * INTEGER_CONTEXTS
                    nodes[node, axis] = last[axis] + code_integer(
                        coder, model, nodes[node, axis] - last[axis]
                    )
                known[node] = True
            if node >= 0:
                last[:] = nodes[node]
        count = offsets[c + 1] - offsets[c]
        if start >= 0:
            last[:] = nodes[start]
        step = np.zeros(2)
        surprise = 4
        for i in range(count):
            k = offsets[c] + i
            level = 0 if surprise < 3 else 1 if surprise < 10 else 2
            surprise = 0
            for axis in range(2):
                ahead = step[axis]
                if start >= 0:
                    to_end = (nodes[end, axis] - last[axis]) / (count - i + 1)
                    ahead = to_end if i == 0 else 0.6 * ahead + 0.4 * to_end
                guess = last[axis] + int(np.floor(ahead + 0.5))
                model = context + _INNER + (axis * 3 + level) * INTEGER_CONTEXTS
                control[k, axis] = guess + code_integer(coder, model, control[k, axis] - guess)
                surprise += abs(control[k, axis] - guess)
            for axis in range(2):
                step[axis] = control[k, axis] - last[axis]
                last[axis] = control[k, axis]
