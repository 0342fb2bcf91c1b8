"""Integers as decisions: the bit length in unary, the sign, and the mantissa."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.mixing import Model, code_decision
from gcvec.codec.range_coder import Coder, rehearses
from gcvec.kernels import bare_kernel, kernel

LONGEST = 24
"""Bit length of the largest integer: magnitudes stay below 2^24."""

NODES = 64
"""Decisions of an integer that are told apart: a context takes so many counters, a selector so many rows."""

_SIGN, _FIRST_BIT, _SECOND_BIT, _LOW_BITS = 16, 20, 30, 48


@bare_kernel
def code_integer(coder: Coder, model: Model, n: int, n_sign: int, row: int, value: int) -> int:
    """Write a signed integer of magnitude below 2^24, or read one.

    Its magnitude is mixed from the first `n` slots, its sign from `n_sign` more after them; `row` is the
    first of its `NODES` rows.
    """
    if rehearses(coder):
        return value
    magnitude = abs(value)
    length = 0
    while magnitude >> length:
        length += 1
    m = 0
    while m < LONGEST:
        node = min(m, _SIGN - 1)
        if code_decision(coder, model, 0, n, node, row + node, 1 if m < length else 0) == 0:
            break
        m += 1
    if m == 0:
        return 0
    node = _SIGN + min(m - 1, 3)
    negative = code_decision(coder, model, n, n_sign, node, row + node, 1 if value < 0 else 0)
    result = 1
    for k in range(m - 2, -1, -1):
        if k == m - 2:
            node = _FIRST_BIT + min(k, 9)
        elif k == m - 3:
            node = _SECOND_BIT + 2 * min(k, 8) + (result & 1)
        else:
            node = _LOW_BITS + min(k, 15)
        result = 2 * result + code_decision(coder, model, 0, n, node, row + node, (magnitude >> k) & 1)
    return -result if negative else result


@bare_kernel
def size_class(value: int) -> int:
    """The class of a size: 0 to 3 are their own, and every further octave has four."""
    if value < 4:
        return value
    length = 3
    while value >> length:
        length += 1
    return 4 * (length - 2) + ((value >> (length - 3)) & 3)


@bare_kernel
def sign(value: int) -> int:
    """0 for zero, 1 for positive, 2 for negative numbers."""
    return 0 if value == 0 else 1 if value > 0 else 2


@kernel
def code_sequence(coder: Coder, model: Model, values: NDArray[np.int64]) -> None:
    """Write integers, or read them into `values`, each predicted by its place among the first 15 and by the
    one before."""
    before = 0
    for i in range(len(values)):
        model.slots[0] = NODES * min(i, 15)
        model.slots[1] = NODES * (16 + min(size_class(abs(before)), 63))
        model.slots[2] = 0
        values[i] = code_integer(coder, model, 2, 1, 0, values[i])
        before = values[i]


SEQUENCE_COUNTERS, SEQUENCE_ROWS, SEQUENCE_INPUTS = NODES * 80, NODES, 2
