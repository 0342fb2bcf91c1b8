"""The labels' text, byte by byte, each predicted by those before it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.mixing import Model, code_decision
from gcvec.codec.range_coder import Coder
from gcvec.kernels import kernel

_ORDERS = 6
"""Contexts: the last 0 to 5 bytes."""

_TABLE_BITS = 16
TEXT_COUNTERS = 1 << _TABLE_BITS
TEXT_ROWS = 256
TEXT_INPUTS = 3
"""Contexts that have seen something before, usually."""


@kernel
def code_text(coder: Coder, model: Model, text: NDArray[np.int64]) -> None:
    """Write bytes `(n,)`, or read them.

    The contexts of all orders share one table, where hashes of up to five bytes and of the bits of this one
    so far say where.
    """
    for i in range(len(text)):
        node = 1
        for shift in range(7, -1, -1):
            mixed = 0
            for order in range(_ORDERS):
                if order and i >= order:
                    mixed = (mixed + text[i - order] + 1) * 0x2C9277B5 & 0xFFFFFFFF
                mixed = (mixed ^ mixed >> 15) * 0x1B873593 & 0xFFFFFFFF
                place = (mixed + node * 0x3C6EF372 & 0xFFFFFFFF) * 0x9E3779B1 & 0xFFFFFFFF
                model.slots[order] = place >> 32 - _TABLE_BITS
            node = 2 * node + code_decision(coder, model, 0, _ORDERS, 0, node, (text[i] >> shift) & 1)
        text[i] = node - 256
