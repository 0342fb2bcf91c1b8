"""Segments that cross, against shapely's exact predicates."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from gcvec.curves.crossings import crossing_segments


def slowly(segments: np.ndarray, asked: np.ndarray) -> np.ndarray:
    """Every pair: an intersection that is more than one common end."""
    bad = (segments[:, 0] == segments[:, 1]).all(axis=1)
    lines = shapely.linestrings(segments)
    for i in range(len(segments)):
        for j in range(i):
            if not (asked[i] or asked[j]) or not shapely.intersects(lines[i], lines[j]):
                continue
            common = sum((p == q).all() for p in segments[i] for q in segments[j])
            met = shapely.intersection(lines[i], lines[j])
            if common != 1 or met.geom_type != "Point":
                bad[[i, j]] = True
    return bad


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 40), whole=st.booleans())
def test_crossings_equal_shapelys(seed: int, n: int, whole: bool) -> None:
    """On a small lattice most pairs touch, overlap or share an end."""
    rng = np.random.default_rng(seed)
    segments = rng.integers(0, 9, (n, 2, 2)) * 4.0 if whole else rng.uniform(0, 60, (n, 2, 2))
    segments[:, 1] = np.where(
        rng.random((n, 1)) < 0.7, segments[:, 0] + (segments[:, 1] - 16) / 4, segments[:, 1]
    )
    if not whole:
        segments[n // 2 :, 0] = segments[: n - n // 2, 1]
    asked = rng.random(n) < 0.6
    found = crossing_segments(segments, asked)
    expected = slowly(segments, asked)
    np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("bend", [-1, 0, 1])
def test_touching_is_told_to_the_last_bit(bend: int) -> None:
    """An end on a slanting line, or beside it by one unit in the last place."""
    y = 1 / 3 * 30
    tip = np.nextafter(y, bend * np.inf) if bend else y
    segments = np.array([[[0.0, 0.0], [3 * y, 3 * y]], [[y, tip], [y, tip + bend + 2 * (bend == 0)]]])
    touches = bool(shapely.intersects(*shapely.linestrings(segments)))
    assert touches == (bend == 0)
    assert crossing_segments(segments, np.ones(2, bool)).all() == touches


def test_long_segments_pass_through_many_cells() -> None:
    fence = np.stack([np.array([[x, 0.0], [x, 50.0]]) for x in np.arange(5.0, 500, 10)])
    rope = np.array([[[0.0, 3.0], [480.0, 45.0]]])
    found = crossing_segments(np.concatenate([fence, rope]), np.ones(len(fence) + 1, bool))
    np.testing.assert_array_equal(found, np.append(fence[:, 0, 0] < 480, True))


def test_nothing() -> None:
    assert not len(crossing_segments(np.zeros((0, 2, 2)), np.zeros(0, bool)))
