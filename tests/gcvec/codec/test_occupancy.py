"""The bitmap of control points: as the format says, and small where points cluster."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gcvec.codec.mixing import fresh_model
from gcvec.codec.occupancy import OCCUPANCY_COUNTERS, OCCUPANCY_INPUTS, OCCUPANCY_ROWS, code_occupancy
from gcvec.codec.range_coder import finish, overrun, reader, writer
from tests.gcvec.plain_decoder import PlainDecoder, plain_bitmap


def coded(bitmap: NDArray[np.uint8]) -> bytes:
    coder = writer(10_000)
    code_occupancy(coder, fresh_model(OCCUPANCY_COUNTERS, OCCUPANCY_ROWS, OCCUPANCY_INPUTS), bitmap.copy())
    data = finish(coder)
    assert data is not None
    return data


def decoded(data: bytes, height: int, width: int) -> NDArray[np.uint8]:
    coder, bitmap = reader(data), np.zeros((height, width), np.uint8)
    code_occupancy(coder, fresh_model(OCCUPANCY_COUNTERS, OCCUPANCY_ROWS, OCCUPANCY_INPUTS), bitmap)
    assert overrun(coder) == 0
    return bitmap


@pytest.mark.parametrize("share", [0.0, 0.02, 0.4, 1.0])
@pytest.mark.parametrize("size", [(1, 1), (3, 40), (40, 3), (60, 50)])
def test_a_bitmap_is_read_as_the_format_says(share: float, size: tuple[int, int]) -> None:
    bitmap = (np.random.default_rng(8).random(size) < share).astype(np.uint8)
    data = coded(bitmap)
    np.testing.assert_array_equal(decoded(data, *size), bitmap)
    np.testing.assert_array_equal(plain_bitmap(PlainDecoder(data), *size), bitmap)


def test_clusters_cost_less_than_the_same_points_scattered() -> None:
    rng = np.random.default_rng(9)
    scattered = (rng.random((200, 200)) < 0.1).astype(np.uint8)
    clustered = np.zeros_like(scattered)
    clustered[:100, :80] = rng.random((100, 80)) < 0.5
    assert len(coded(clustered)) < 0.6 * len(coded(scattered))
