"""Integers, sequences and text come back as they were written, and as the format says."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcvec.codec.integers import SEQUENCE_COUNTERS, SEQUENCE_INPUTS, SEQUENCE_ROWS, code_sequence, size_class
from gcvec.codec.mixing import fresh_model
from gcvec.codec.range_coder import finish, overrun, reader, writer
from gcvec.codec.text import TEXT_COUNTERS, TEXT_INPUTS, TEXT_ROWS, code_text
from tests.gcvec.plain_decoder import PlainDecoder, PlainModel, plain_sequence, plain_text

LARGEST = 2**24 - 1


@given(st.lists(st.one_of(st.integers(-LARGEST, LARGEST), st.integers(-9, 9)), max_size=60))
def test_a_sequence_is_read_as_it_was_written(values: list[int]) -> None:
    coder = writer(1000)
    code_sequence(
        coder, fresh_model(SEQUENCE_COUNTERS, SEQUENCE_ROWS, SEQUENCE_INPUTS), np.array(values, np.int64)
    )
    data = finish(coder)
    assert data is not None
    coder, read = reader(data), np.zeros(len(values), np.int64)
    code_sequence(coder, fresh_model(SEQUENCE_COUNTERS, SEQUENCE_ROWS, SEQUENCE_INPUTS), read)
    assert read.tolist() == values
    assert plain_sequence(PlainDecoder(data), len(values), PlainModel(inputs=2)) == values
    assert overrun(coder) == 0


def coded_text(text: bytes) -> bytes:
    coder = writer(100 + 4 * len(text))
    code_text(
        coder,
        fresh_model(TEXT_COUNTERS, TEXT_ROWS, TEXT_INPUTS),
        np.frombuffer(text, np.uint8).astype(np.int64),
    )
    data = finish(coder)
    assert data is not None
    return data


@given(st.binary(max_size=200))
def test_text_is_read_as_it_was_written(text: bytes) -> None:
    data, read = coded_text(text), np.zeros(len(text), np.int64)
    code_text(reader(data), fresh_model(TEXT_COUNTERS, TEXT_ROWS, TEXT_INPUTS), read)
    assert read.astype(np.uint8).tobytes() == text
    assert plain_text(PlainDecoder(data), len(text)) == text


def test_labels_that_are_much_alike_take_few_bytes() -> None:
    labels = ", ".join(f'"region-{i}"' for i in range(64)).encode()
    assert len(coded_text(labels)) < len(labels) / 5


@pytest.mark.parametrize(
    ("value", "expected"), [(0, 0), (3, 3), (4, 4), (7, 7), (8, 8), (9, 8), (10, 9), (15, 11), (16, 12)]
)
def test_size_classes_are_quarters_of_octaves(value: int, expected: int) -> None:
    assert size_class(value) == expected


def test_size_classes_grow_with_the_size() -> None:
    classes = [size_class(value) for value in range(5000)]
    assert classes == sorted(classes)
    assert size_class(2 * 1000) == size_class(1000) + 4
