"""Topology of boundary curves: which patches each parts, where it begins and ends, and of what kind it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.integers import NODES, code_integer, size_class
from gcvec.codec.mixing import Model, code_decision
from gcvec.codec.range_coder import Coder
from gcvec.kernels import bare_kernel, kernel

Ints = NDArray[np.int64]

LEFT_PATCH, RIGHT_PATCH, START, END, LEVEL, SEGMENTS, HARD = range(7)
"""Columns of the table of curves."""

_GOES_ON, _CLOSED, _NEW_START, _NEW_END, _IS_HARD = range(5)
"""Flags, whose contexts are those of number 0."""

_STEP_LEFT, _STEP_RIGHT, _OLD_START, _OLD_END, _LEVEL, _SEGMENTS = range(1, 7)
"""Numbers."""

_CONTEXT_SIZE = 64
TOPOLOGY_COUNTERS, TOPOLOGY_ROWS, TOPOLOGY_INPUTS = 7 * 2 * _CONTEXT_SIZE * NODES, 7 * NODES, 2


@bare_kernel
def _choose(model: Model, number: int, context: int) -> None:
    """Choose the contexts of a number: none at all, and the one given; for its sign, none."""
    model.slots[0] = model.slots[2] = number * 2 * _CONTEXT_SIZE * NODES
    model.slots[1] = ((number * 2 + 1) * _CONTEXT_SIZE + context) * NODES


@bare_kernel
def _code_number(coder: Coder, model: Model, number: int, context: int, value: int) -> int:
    _choose(model, number, context)
    coded: int = code_integer(coder, model, 2, 1, number * NODES, value)
    return coded


@bare_kernel
def _code_flag(coder: Coder, model: Model, flag: int, context: int, bit: int) -> int:
    _choose(model, 0, context)
    coded: int = code_decision(coder, model, 0, 2, flag, flag, bit)
    return coded


@kernel
def code_topology(coder: Coder, model: Model, table: Ints) -> None:
    """Write the table of curves `(c, 7)`, or read it. Nodes must be numbered in the order in which curves
    meet them.

    A curve often goes on where the last one, of the same border, ended at a corner.
    """
    left, right, node, next_node = 0, 0, -1, 0
    segments, hard, went_on = 0, 0, 0
    for c in range(len(table)):
        goes_on = (
            table[c, START] == node
            and table[c, LEFT_PATCH] == left
            and table[c, RIGHT_PATCH] == right
            and node >= 0
        )
        framed = 1 if left < 0 or right < 0 else 0
        goes_on = _code_flag(coder, model, _GOES_ON, 2 * went_on + framed, 1 if goes_on else 0) == 1
        if not goes_on:
            table[c, LEFT_PATCH] = left + _code_number(
                coder, model, _STEP_LEFT, framed, table[c, LEFT_PATCH] - left
            )
            moved = min(abs(table[c, LEFT_PATCH] - left), 3)
            table[c, RIGHT_PATCH] = right + _code_number(
                coder, model, _STEP_RIGHT, 4 * framed + moved, table[c, RIGHT_PATCH] - right
            )
            closed = _code_flag(coder, model, _CLOSED, 0, 1 if table[c, START] < 0 else 0)
            if closed:
                table[c, START] = table[c, END] = -1
            else:
                table[c, START] = _code_node(coder, model, _NEW_START, table[c, START], next_node)
                next_node = max(next_node, table[c, START] + 1)
        else:
            table[c, LEFT_PATCH], table[c, RIGHT_PATCH], table[c, START] = left, right, node
        if table[c, START] >= 0:
            table[c, END] = _code_node(coder, model, _NEW_END, table[c, END], next_node)
            next_node = max(next_node, table[c, END] + 1)
        went_on = 1 if goes_on else 0
        left, right, node = table[c, LEFT_PATCH], table[c, RIGHT_PATCH], table[c, END]
        framed = 1 if left < 0 or right < 0 else 0
        hard = table[c, HARD] = _code_flag(
            coder, model, _IS_HARD, 4 * framed + 2 * went_on + hard, table[c, HARD]
        )
        segments = table[c, SEGMENTS] = _code_number(
            coder,
            model,
            _SEGMENTS,
            16 * (2 * framed + went_on) + min(size_class(abs(segments)), 15),
            table[c, SEGMENTS],
        )
        table[c, LEVEL] = _code_number(
            coder, model, _LEVEL, 16 * framed + min(abs(segments), 15), table[c, LEVEL]
        )


@kernel
def _code_node(coder: Coder, model: Model, flag: int, node: int, next_node: int) -> int:
    if _code_flag(coder, model, flag, 0, 1 if node == next_node else 0):
        return next_node
    kind = _OLD_START if flag == _NEW_START else _OLD_END
    back: int = _code_number(coder, model, kind, 0, next_node - 1 - node)
    return next_node - 1 - back
