"""Mixing, and the range coder under it, against the same in plain Python."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcvec.codec.mixing import INPUTS, KNOTS, Model, code_decision, fresh_model
from gcvec.codec.range_coder import finish, overrun, reader, writer
from tests.gcvec.plain_decoder import PlainDecoder, PlainModel, squash_knots

CONTEXTS, ROWS = 40, 3


def contexts_of(rng: np.random.Generator, n: int) -> tuple[list[list[int]], list[int]]:
    """Which counters and row each of 4000 decisions is under: some often, some seldom."""
    counters = np.minimum(rng.geometric(0.2, (4000, n)) - 1, CONTEXTS - 1) * INPUTS + np.arange(n)
    return counters.tolist(), rng.integers(0, ROWS, 4000).tolist()


def fresh() -> Model:
    return fresh_model(CONTEXTS * INPUTS, ROWS, INPUTS)


@pytest.mark.parametrize("n", [1, 3, INPUTS])
@pytest.mark.parametrize("share", [0.001, 0.3, 1.0])
def test_decisions_are_read_as_the_format_says(n: int, share: float) -> None:
    rng = np.random.default_rng(n)
    counters, rows = contexts_of(rng, n)
    bits = (rng.random(4000) < share * rng.random(CONTEXTS * INPUTS)[np.array(counters)[:, 0]]).tolist()
    coder, model = writer(4000), fresh()
    for slots, row, bit in zip(counters, rows, bits, strict=True):
        model.slots[:n] = slots
        code_decision(coder, model, 0, n, 0, row, int(bit))
    data = finish(coder)
    assert data is not None
    decoder, plain = PlainDecoder(data), PlainModel(inputs=INPUTS)
    assert [plain.decision(decoder, *where) for where in zip(counters, rows, strict=True)] == bits
    for counter, (probability, seen) in plain.counters.items():
        assert model.counters[counter] == (probability - (1 << 21)) * 512 + seen
    for row, weights in plain.weights.items():
        assert model.weights[row].tolist() == weights
        assert model.corrections[row].tolist() == plain.corrections[row]


@given(st.lists(st.tuples(st.integers(0, 65536), st.booleans()), max_size=300), st.integers(0, 2**32 - 1))
def test_what_is_written_is_read(decisions: list[tuple[int, bool]], seed: int) -> None:
    rng = np.random.default_rng(seed)
    counters, rows = contexts_of(rng, 2)
    coder, model = writer(1000), fresh()
    for (_, bit), slots, row in zip(decisions, counters, rows, strict=False):
        model.slots[:2] = slots
        code_decision(coder, model, 0, 2, 0, row, int(bit))
    data = finish(coder)
    assert data is not None
    coder, model = reader(data), fresh()
    for (_, bit), slots, row in zip(decisions, counters, rows, strict=False):
        model.slots[:2] = slots
        assert code_decision(coder, model, 0, 2, 0, row, 0) == bit
    assert overrun(coder) == 0


def test_good_contexts_are_found_among_bad_ones() -> None:
    """Of eight contexts one tells nearly everything: mixing needs little more than its entropy."""
    rng = np.random.default_rng(1)
    counters, _ = contexts_of(rng, INPUTS)
    telling = np.array(counters)[:, 5] // INPUTS % 2
    bits = telling ^ (rng.random(4000) < 0.02)
    coder, model = writer(4000), fresh()
    for slots, bit in zip(counters, bits, strict=True):
        model.slots[:INPUTS] = slots
        code_decision(coder, model, 0, INPUTS, 0, 0, int(bit))
    data = finish(coder)
    assert data is not None
    entropy = -(0.02 * np.log2(0.02) + 0.98 * np.log2(0.98))
    assert len(data) * 8 < 2 * entropy * 4000


def test_knots_are_those_of_the_logistic_function() -> None:
    assert list(KNOTS) == squash_knots()
