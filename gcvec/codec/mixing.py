"""Decisions predicted by several contexts at once: logistic mixing, in integers.

Every decision has a few contexts, each with a counter that has learned how often it came out as 1. Their
log-odds are added up with weights that learn which of them to trust, and the sum is corrected by what came of
such sums before (Mahoney, "Adaptive weighing of context models for lossless data compression", 2005; the last
stage is the adaptive probability map of his PAQ coders). All arithmetic is on integers, so every decoder
computes the same.

Probabilities are those of a 1, in units of 2^-16; log-odds are natural, in units of 1/256, within ±8.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.range_coder import Coder, code_bit
from gcvec.kernels import bare_kernel

KNOTS = (
    *(22, 36, 60, 98, 162, 267, 439, 720, 1179, 1921, 3108, 4971, 7812, 11955, 17625, 24743),
    *(32768, 40793, 47911, 53581, 57724, 60565, 62428, 63615, 64357, 64816, 65097, 65269, 65374, 65438),
    *(65476, 65500, 65514),
)
"""Probabilities at log-odds of -8, -7.5, ..., 8."""

SLOTS = 16
"""Contexts that can be chosen at a time."""

INPUTS = 8
"""Contexts of one decision at most."""

_LIMIT = 255
"""Decisions that a counter counts: from there on it follows the latest at one rate."""

_LEARNING = 2
"""Of the weights, per error. It is part of the format, as are all numbers here: others make other files."""

_FIRST_WEIGHTS = 72_000
"""What the weights of a decision's contexts add up to at first, in 2^-16: a little over one, since each of
them alone is too careful."""


def _squash_table() -> NDArray[np.int64]:
    """Probabilities `(4096,)` at log-odds of -2048 to 2047: linear between the knots."""
    at = np.arange(4096)
    knots = np.array(KNOTS)
    return np.asarray((knots[at >> 7] * (128 - (at & 127)) + knots[(at >> 7) + 1] * (at & 127)) >> 7)


_SQUASH = _squash_table()

_STRETCH = np.searchsorted(_SQUASH, np.arange(8, 65536, 16)) - 2048
_STRETCH = np.clip(_STRETCH, -2047, 2047)
"""Log-odds `(4096,)` of probabilities in units of 2^-12: the least whose probability is no smaller."""

_RATE = (2 << 16) // (2 * np.arange(_LIMIT + 1) + 3)
_TRUST = (np.arange(_LIMIT + 1) * 5 << 8) // (np.arange(_LIMIT + 1) * 5 + 6)
"""By how many decisions a counter has seen: how much of the way it goes to the next, in 2^-16, and how much
its log-odds count, in 2^-8."""


class Model(NamedTuple):
    """What has been learned about a kind of decision.

    counters    (c,) int32, a probability in 2^-22, less one half, times 512, plus how many decisions it saw
    weights     (r, INPUTS) int64, in 2^-16
    corrections (r, 33) int64, the probability that a mixed one at each of the knots stands for
    slots       (SLOTS,) int64, where the counters of the contexts chosen begin
    stretched   (INPUTS,) int64, scratch: the log-odds that are mixed
    """

    counters: NDArray[np.int32]
    weights: NDArray[np.int64]
    corrections: NDArray[np.int64]
    slots: NDArray[np.int64]
    stretched: NDArray[np.int64]


def fresh_model(counters: int, rows: int, inputs: int) -> Model:
    """A model that has learned nothing, for decisions that usually have so many contexts."""
    return Model(
        np.zeros(counters, np.int32),
        np.full((rows, INPUTS), _FIRST_WEIGHTS // inputs),
        np.tile(np.array(KNOTS), (rows, 1)),
        np.zeros(SLOTS, np.int64),
        np.zeros(INPUTS, np.int64),
    )


@bare_kernel
def place_contexts(model: Model, begin: int, first: int, last: int, size: int, counters: int) -> None:
    """Turn the numbers in slots `first` to `last - 1` into places of counters.

    Every slot has `size` contexts of so many `counters`; those of slot 0 are at `begin`.
    """
    for k in range(first, last):
        model.slots[k] = begin + (k * size + model.slots[k]) * counters


@bare_kernel
def code_decision(coder: Coder, model: Model, first: int, n: int, node: int, row: int, bit: int) -> int:
    """Write `bit`, or read one, under the contexts in slots `first` to `first + n - 1`.

    `node` says which decision it is of those that each context keeps counters for; `row` chooses weights and
    corrections.
    """
    dot = 0
    for k in range(n):
        counter = model.counters[model.slots[first + k] + node]
        stretched = (_STRETCH[(counter >> 19) + 2048] * _TRUST[counter & 511]) >> 8
        model.stretched[k] = stretched
        dot += model.weights[row, k] * stretched
    dot = min(max(dot >> 16, -2047), 2047)
    mixed = _SQUASH[dot + 2048]
    knot, part = (dot + 2048) >> 7, (dot + 2048) & 127
    low, high = model.corrections[row, knot], model.corrections[row, knot + 1]
    corrected = (low * (128 - part) + high * part) >> 7
    bit = code_bit(coder, (mixed + corrected + 1) >> 1, bit)

    error = (bit << 16) - mixed
    nearest = knot + (part >> 6)
    model.corrections[row, nearest] += ((bit << 16) - model.corrections[row, nearest]) >> 6
    for k in range(n):
        model.weights[row, k] += (model.stretched[k] * error * _LEARNING + (1 << 15)) >> 16
        at = model.slots[first + k] + node
        counter = model.counters[at]
        seen = counter & 511
        probability = (counter >> 9) + (1 << 21)
        probability += (((bit << 22) - probability) * _RATE[seen]) >> 16
        model.counters[at] = ((probability - (1 << 21)) << 9) | min(seen + 1, _LIMIT)
    return bit
