"""Adaptive binary range coding.

A range coder with carry propagation (Martin 1979, in the byte-wise form of the LZMA format) codes single
decisions, each under a context that learns its probability as the mean of a fast and a slow estimate.
Integers are coded as decisions: the bit length in unary, the sign, and the mantissa with learned leading
bits.

One function serves both directions: `code_bit` writes the bit it is given when the coder writes, and returns
the next bit of the data when it reads. Models built on it are therefore the same for both by construction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Slots of a coder's state.
_WRITING, _LOW, _RANGE, _CACHE, _PENDING, _AT, _CODE, _PAST_END = range(8)

_PROBABILITY_BITS = 16
_FAST, _SLOW = 4, 7
_TOP = 1 << 24
_FULL = 0xFFFFFFFF

INTEGER_CONTEXTS = 128
"""Contexts that one integer model takes."""

_LONGEST = 24
"""Bit length of the largest integer: magnitudes stay below 2^24."""


class Coder(NamedTuple):
    """A range coder: its registers, its bytes, and two probability estimates for every context."""

    state: NDArray[np.int64]
    data: NDArray[np.uint8]
    contexts: NDArray[np.int64]


def writer(capacity: int, contexts: int) -> Coder:
    """A coder that writes up to `capacity` bytes."""
    state = np.array([1, 0, _FULL, 0, 1, 0, 0, 0], np.int64)
    return Coder(state, np.zeros(capacity, np.uint8), _fresh(contexts))


def reader(data: bytes, contexts: int) -> Coder:
    """A coder that reads `data`; past their end it reads zeros and counts how many."""
    state = np.array([0, 0, _FULL, 0, 0, 0, 0, 0], np.int64)
    coder = Coder(state, np.array(bytearray(data), np.uint8), _fresh(contexts))
    for _ in range(4):
        _shift_in(coder)
    return coder


def finish(coder: Coder) -> bytes | None:
    """The bytes written; None when they did not fit."""
    for _ in range(5):
        _shift_out(coder)
    if coder.state[_AT] > len(coder.data):
        return None
    # The first byte is always zero.
    return coder.data[1 : coder.state[_AT]].tobytes()


def overrun(coder: Coder) -> int:
    """How many bytes past the end of the data have been read."""
    return int(coder.state[_PAST_END])


def _fresh(contexts: int) -> NDArray[np.int64]:
    return np.full((contexts, 2), 1 << (_PROBABILITY_BITS - 1), np.int64)


@njit(cache=True, nogil=True)
def _emit(coder: Coder, byte: int) -> None:
    at = coder.state[_AT]
    if at < len(coder.data):
        coder.data[at] = byte & 0xFF
    coder.state[_AT] = at + 1


@njit(cache=True, nogil=True)
def _shift_out(coder: Coder) -> None:
    state = coder.state
    low = state[_LOW]
    if low < 0xFF000000 or low > _FULL:
        carry = low >> 32
        _emit(coder, state[_CACHE] + carry)
        for _ in range(state[_PENDING] - 1):
            _emit(coder, 0xFF + carry)
        state[_PENDING] = 0
        state[_CACHE] = (low >> 24) & 0xFF
    state[_PENDING] += 1
    state[_LOW] = (low & 0x00FFFFFF) << 8


@njit(cache=True, nogil=True)
def _shift_in(coder: Coder) -> None:
    state = coder.state
    at = state[_AT]
    byte = 0
    if at < len(coder.data):
        byte = coder.data[at]
    else:
        state[_PAST_END] += 1
    state[_AT] = at + 1
    state[_CODE] = ((state[_CODE] << 8) | byte) & _FULL


@njit(cache=True, nogil=True)
def code_bit(coder: Coder, context: int, bit: int) -> int:
    """Write `bit` under a context, or read one."""
    state = coder.state
    fast, slow = coder.contexts[context, 0], coder.contexts[context, 1]
    bound = (state[_RANGE] >> _PROBABILITY_BITS) * ((fast + slow) >> 1)
    if state[_WRITING] == 0:
        bit = 0 if state[_CODE] < bound else 1
    if bit == 0:
        state[_RANGE] = bound
        fast += (65536 - 32 - fast) >> _FAST
        slow += (65536 - 32 - slow) >> _SLOW
    else:
        if state[_WRITING] == 0:
            state[_CODE] -= bound
        else:
            state[_LOW] += bound
        state[_RANGE] -= bound
        fast -= (fast - 32) >> _FAST
        slow -= (slow - 32) >> _SLOW
    coder.contexts[context, 0], coder.contexts[context, 1] = fast, slow
    while state[_RANGE] < _TOP:
        state[_RANGE] = (state[_RANGE] << 8) & _FULL
        if state[_WRITING] == 0:
            _shift_in(coder)
        else:
            _shift_out(coder)
    return bit


@njit(cache=True, nogil=True)
def code_integer(coder: Coder, context: int, value: int) -> int:
    """Write a signed integer of magnitude below 2^24 under `INTEGER_CONTEXTS` contexts, or read one."""
    magnitude = abs(value)
    length = 0
    while magnitude >> length:
        length += 1
    n = 0
    while n < _LONGEST and code_bit(coder, context + n, 1 if n < length else 0):
        n += 1
    if n == 0:
        return 0
    negative = code_bit(coder, context + 25, 1 if value < 0 else 0)
    result = 1
    for k in range(n - 2, -1, -1):
        depth = n - 2 - k
        if depth < 2:
            slot = 26 + 3 * (n - 2) + (0 if depth == 0 else 1 + (result & 1))
        else:
            slot = 100 + min(k, 20)
        result = 2 * result + code_bit(coder, context + slot, (magnitude >> k) & 1)
    return -result if negative else result


@njit(cache=True, nogil=True)
def code_sequence(coder: Coder, context: int, values: NDArray[np.int64]) -> None:
    """Write integers, or read them into `values`, each under a model chosen by the one before.

    Takes three integer models: after a zero, after a small value, after a large one.
    """
    before = 0
    for i in range(len(values)):
        model = 0 if before == 0 else 1 if abs(before) < 4 else 2
        values[i] = code_integer(coder, context + model * INTEGER_CONTEXTS, values[i])
        before = values[i]


SEQUENCE_CONTEXTS = 3 * INTEGER_CONTEXTS


@njit(cache=True, nogil=True)
def code_occupancy(coder: Coder, context: int, occupied: NDArray[np.uint8]) -> None:
    """Write a bitmap `(h, w)`, or read it, row by row.

    The context is what is set nearby: the pixels left and above, how many of the 20 seen pixels around, and
    how
    dense the bitmap has been further up and to the left.
    """
    height, width = occupied.shape
    column = np.zeros(width + 2, np.int64)
    for y in range(height):
        row = 0
        for x in range(width):
            touching = 0
            if x > 0:
                touching += occupied[y, x - 1]
            near = 0
            if y > 0:
                touching += 2 * occupied[y - 1, x]
            for dy in range(1, 4):
                if y - dy < 0:
                    break
                for dx in range(-2, 3):
                    if 0 <= x + dx < width:
                        near += occupied[y - dy, x + dx]
            for dx in range(1, 6):
                if x - dx >= 0:
                    near += occupied[y, x - dx]
            far = (2 * column[x + 1] + column[x] + column[x + 2] + 4 * row) >> 3
            band = 0
            while band < 11 and far > (64 << band) >> 3:
                band += 1
            slot = (min(near, 7) * 12 + band) * 4 + touching
            bit = code_bit(coder, context + slot, occupied[y, x])
            occupied[y, x] = bit
            column[x + 1] += ((bit << 14) - column[x + 1]) >> 4
            row += ((bit << 14) - row) >> 4


OCCUPANCY_CONTEXTS = 8 * 12 * 4
