from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import ndimage

from gcvec.regions.gaps import UNCOVERED, _components, close_gaps


def closed(owners: NDArray[np.int32]) -> NDArray[np.int32]:
    result = owners.copy()
    close_gaps(result)
    return result


def two_regions(gap: int) -> NDArray[np.int32]:
    owners = np.zeros((40, 40), dtype=np.int32)
    owners[:, 20:] = 1
    owners[:, 20 : 20 + gap] = UNCOVERED
    return owners


@pytest.mark.parametrize("gap", [1, 2, 3, 4])
def test_a_thin_gap_is_shared_by_its_neighbours(gap: int) -> None:
    result = closed(two_regions(gap))
    assert (result != UNCOVERED).all()
    border = 20 + (gap + 1) // 2  # a pixel as far from one as from the other goes left
    expected = np.where(np.arange(40) < border, 0, 1)
    np.testing.assert_array_equal(result, np.broadcast_to(expected, (40, 40)))


@pytest.mark.parametrize("gap", [5, 8])
def test_a_wide_gap_is_background(gap: int) -> None:
    owners = two_regions(gap)
    np.testing.assert_array_equal(closed(owners), owners)


def test_a_thin_diagonal_gap_closes_and_a_wide_one_stays() -> None:
    y, x = np.mgrid[:60, :60]
    for width, stays in ((5, False), (9, True)):
        owners = np.where(x + y < 60, 0, np.where(x + y < 60 + width, UNCOVERED, 1)).astype(np.int32)
        assert (closed(owners)[20:40, 20:40] == UNCOVERED).any() == stays


def test_a_strip_along_the_frame_closes() -> None:
    owners = np.full((30, 40), 7, dtype=np.int32)
    owners[:2] = UNCOVERED
    owners[:, -3:] = UNCOVERED
    assert (closed(owners) == 7).all()


def test_real_background_keeps_its_corners() -> None:
    boxes = np.full((40, 60), UNCOVERED, dtype=np.int32)
    boxes[10:30, :20] = 0  # touches the frame
    boxes[15:25, 30:50] = 1
    np.testing.assert_array_equal(closed(boxes), boxes)


def test_an_acute_notch_of_a_single_shape_stays_as_drawn() -> None:
    y, x = np.mgrid[:60, :60]
    notch = np.abs(y - 30) * 4 < x - 20
    owners = np.where(notch | (x >= 50), UNCOVERED, 0).astype(np.int32)
    np.testing.assert_array_equal(closed(owners), owners)


def test_nothing_covered_or_nothing_uncovered_changes_nothing() -> None:
    for value in (UNCOVERED, 0):
        owners = np.full((3, 4), value, dtype=np.int32)
        np.testing.assert_array_equal(closed(owners), owners)


def test_components_are_scipys() -> None:
    mask = np.random.default_rng(0).uniform(size=(30, 41)) < 0.3
    np.testing.assert_array_equal(_components(mask), ndimage.label(mask, np.ones((3, 3)))[0])


@pytest.mark.parametrize(("length", "closes"), [(5, False), (6, True)])
def test_only_a_strip_of_some_length_along_the_frame_closes(length: int, closes: bool) -> None:
    owners = np.full((20, 30), 7, dtype=np.int32)
    owners[0, 10 : 10 + length] = UNCOVERED
    assert (closed(owners) == 7).all() == closes


def test_corners_of_the_frame_count_once() -> None:
    """Five pixels around a corner, all of them on the frame."""
    owners = np.full((20, 30), 7, dtype=np.int32)
    owners[:3, 0] = owners[0, :3] = UNCOVERED
    np.testing.assert_array_equal(closed(owners), owners)
