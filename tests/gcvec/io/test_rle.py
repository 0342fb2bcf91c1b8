from __future__ import annotations

from itertools import groupby

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from gcvec.io.rle import ColumnRuns, decode_compressed_counts, row_major_mask

masks = arrays(np.bool_, st.tuples(st.integers(1, 9), st.integers(1, 9)))


def runs(flat: NDArray[np.bool_]) -> list[int]:
    """Lengths of the runs, the first one background."""
    lengths = [len(list(group)) for _, group in groupby(flat.tolist())]
    return [0, *lengths] if flat[0] else lengths


def compressed(counts: list[int]) -> str:
    """The encoder of the COCO tools, spelt out."""
    text = ""
    for i, count in enumerate(counts):
        value = count - counts[i - 2] if i > 2 else count
        while True:
            digit, value = value & 31, value >> 5
            last = value == (-1 if digit & 16 else 0)
            text += chr(48 + (digit if last else digit | 32))
            if last:
                break
    return text


@given(masks)
def test_rows_come_back(mask: NDArray[np.bool_]) -> None:
    height, width = mask.shape
    np.testing.assert_array_equal(row_major_mask(np.array(runs(mask.ravel())), width, height), mask)


@given(masks)
def test_columns_come_back_cropped(mask: NDArray[np.bool_]) -> None:
    decoded = ColumnRuns(np.array(runs(mask.T.ravel())), mask.shape[0])
    left, top, width, height = decoded.box
    assert decoded.mask().shape == (height, width)
    whole = np.zeros_like(mask)
    whole[top : top + height, left : left + width] = decoded.mask()
    np.testing.assert_array_equal(whole, mask)


def test_runs_of_no_length_are_no_runs() -> None:
    decoded = ColumnRuns(np.array([2, 1, 0, 1, 0, 0, 8]), 4)
    assert decoded.box == (0, 2, 1, 2)
    assert decoded.mask().all()


@given(st.lists(st.integers(0, 2**40), max_size=30))
def test_compressed_counts_come_back(counts: list[int]) -> None:
    assert decode_compressed_counts(compressed(counts)) == counts


def test_a_code_known_from_the_coco_tools() -> None:
    assert decode_compressed_counts("52203OO") == [5, 2, 2, 2, 5, 1, 4]


@pytest.mark.parametrize("text", ["5 2", "é", "o", "5o", "o" * 40 + "0", "/"])
def test_broken_codes_are_refused(text: str) -> None:
    with pytest.raises(ValueError, match="code"):
        decode_compressed_counts(text)
