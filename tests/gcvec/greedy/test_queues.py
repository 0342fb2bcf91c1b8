"""Which triangles are next, and how many points make up for what is missing."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gcvec.greedy.queues import FALL, MOST_BETTER, NONE_FULL, SAVED, FullPatches, Queue, how_many, useful

gains = hnp.arrays(float, st.integers(0, 40), elements=st.floats(0.01, 10)).map(lambda g: np.sort(g)[::-1])


@given(gains, st.floats(0, 200))
def test_as_many_points_as_make_up_for_what_is_missing(gain: np.ndarray, missing: float) -> None:
    """The first with which all together save so much, counted from 0; all of them where none is enough."""
    n = how_many(gain, lambda _: missing)
    saved = FALL * np.cumsum(gain)
    assert (saved[:n] < missing).all()
    assert (saved[n:] >= missing).all()


@given(gains.filter(len), st.floats(1, 100))
def test_what_is_missing_is_asked_at_the_price_of_the_last_point(gain: np.ndarray, missing: float) -> None:
    """The lower the price, the more others would have saved too, and the less is missing."""
    n = how_many(gain, lambda price: missing * price)
    enough = FALL * np.cumsum(gain) >= missing * gain
    assert n == (enough.argmax() if enough.any() else len(gain))


def test_without_full_patches_the_error_beyond_the_goal_is_missing() -> None:
    assert NONE_FULL.missing(7.0, 4.0, 0.5) == 3.0


def test_full_patches_are_excused_from_what_points_at_this_price_would_have_saved() -> None:
    """Errors go with the power `SAVED` of the price: 0.6 is that of an error that falls with n^-1.5."""
    full = FullPatches(np.array([10.0, 5.0]), np.array([8.0, 0.1]), 0.1)
    assert full.missing(100.0, 40.0, 1.0) == pytest.approx(60 - 10 * (1 - 8**-SAVED))
    assert pytest.approx(1.5 / 2.5) == SAVED


def test_others_are_not_made_much_better_than_all_should_be() -> None:
    """Where full patches have nearly all of the error, what others lack to half the goal on their area."""
    full = FullPatches(np.array([90.0]), np.array([1e-6]), 0.25)
    assert full.missing(100.0, 20.0, 1.0) == pytest.approx(10 - MOST_BETTER * 20 * 0.75)


def test_patches_that_no_point_would_help_lack_nothing() -> None:
    assert FullPatches(np.array([50.0]), np.array([0.0]), 0.5).missing(60.0, 55.0, 0.0) <= 5.0


def test_triangles_in_use_that_save_something_are_useful() -> None:
    counts, gain = np.array([4, 0, 0, 0, 0, 0]), np.array([0.0, 2.0, -1.0, 3.0, 9.0])
    strip = SimpleNamespace(counts=counts, gain=gain, patch=np.array([0, 1, 1, 2, 5]))
    found = useful(strip)
    assert found.triangle.tolist() == [1, 3]
    assert found.gain.tolist() == [2.0, 3.0]
    assert found.patch.tolist() == [1, 2]


def test_a_part_of_a_queue_keeps_its_columns_together() -> None:
    columns = (np.arange(4) + 10 * k for k in range(4))
    part = Queue(*columns).where(np.array([True, False, False, True]))
    assert [column.tolist() for column in part] == [[0, 3], [10, 13], [20, 23], [30, 33]]
