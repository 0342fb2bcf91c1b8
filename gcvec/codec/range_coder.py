"""Binary range coding.

A range coder with carry propagation (Martin 1979, in the byte-wise form of the LZMA format) codes single
decisions, each with the probability it is given.

One function serves both directions: `code_bit` writes the bit it is given when the coder writes, and returns
the next bit of the data when it reads. Models built on it are therefore the same for both by construction. A
coder may also rehearse: then nothing comes of it but what values are rounded to on their way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import bare_kernel, kernel

# Slots of a coder's state.
_MODE, _LOW, _RANGE, _CACHE, _PENDING, _AT, _CODE, _PAST_END = range(8)

_READING, _WRITING, _REHEARSING = range(3)

_TOP = 1 << 24
_FULL = 0xFFFFFFFF

LEAST = 24
"""Neither outcome of a decision is held to be less likely than this, in 2^-16."""


class Coder(NamedTuple):
    """A range coder: its registers, and its bytes."""

    state: NDArray[np.int64]
    data: NDArray[np.uint8]


def writer(capacity: int) -> Coder:
    """A coder that writes up to `capacity` bytes."""
    return Coder(np.array([_WRITING, 0, _FULL, 0, 1, 0, 0, 0], np.int64), np.zeros(capacity, np.uint8))


def rehearser() -> Coder:
    """A coder that takes what it is given, and writes nothing."""
    return Coder(np.array([_REHEARSING, 0, _FULL, 0, 1, 0, 0, 0], np.int64), np.zeros(0, np.uint8))


def reader(data: bytes) -> Coder:
    """A coder that reads `data`; past their end it reads zeros and counts how many."""
    state = np.array([_READING, 0, _FULL, 0, 0, 0, 0, 0], np.int64)
    coder = Coder(state, np.array(bytearray(data), np.uint8))
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


@bare_kernel
def rehearses(coder: Coder) -> bool:
    """Whether a coder only rehearses: no decision needs to be coded then."""
    rehearsing: bool = coder.state[_MODE] == _REHEARSING
    return rehearsing


@kernel
def _emit(coder: Coder, byte: int) -> None:
    at = coder.state[_AT]
    if at < len(coder.data):
        coder.data[at] = byte & 0xFF
    coder.state[_AT] = at + 1


@kernel
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


@kernel
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


@bare_kernel
def code_bit(coder: Coder, probability: int, bit: int) -> int:
    """Write `bit`, or read one; a 1 is expected with `probability`, in units of 2^-16."""
    state = coder.state
    bound = (state[_RANGE] >> 16) * min(max(probability, LEAST), 65536 - LEAST)
    if state[_MODE] == _READING:
        bit = 1 if state[_CODE] < bound else 0
    if bit:
        state[_RANGE] = bound
    else:
        if state[_MODE] == _READING:
            state[_CODE] -= bound
        else:
            state[_LOW] += bound
        state[_RANGE] -= bound
    while state[_RANGE] < _TOP:
        state[_RANGE] = (state[_RANGE] << 8) & _FULL
        if state[_MODE] == _READING:
            _shift_in(coder)
        else:
            _shift_out(coder)
    return bit
