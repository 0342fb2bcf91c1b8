from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gcvec.regions.polygon_fill import fill_ring

eighths = st.integers(-24, 120).map(lambda n: n / 8)
rings = st.lists(st.tuples(eighths, eighths), min_size=1, max_size=9).map(lambda p: np.array(p, dtype=float))


def winding_number(ring: NDArray[np.float64], x: Fraction, y: Fraction) -> int:
    """In exact arithmetic, looking left from (x, y); a point on an edge counts as right of it."""
    turns = 0
    points = [(Fraction(px), Fraction(py)) for px, py in ring.tolist()]
    for (x0, y0), (x1, y1) in zip(points, points[1:] + points[:1], strict=True):
        if (y0 <= y) == (y1 <= y):
            continue
        crossing = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
        if crossing <= x:
            turns += 1 if y1 > y0 else -1
    return turns


def filled(ring: NDArray[np.float64], height: int = 12, width: int = 13) -> NDArray[np.int32]:
    canvas = np.zeros((height, width), dtype=np.int32)
    fill = fill_ring(canvas, ring, 1)
    assert fill.pixels == canvas.sum()
    return canvas


@given(rings)
def test_matches_the_winding_number_in_exact_arithmetic(ring: NDArray[np.float64]) -> None:
    half = Fraction(1, 2)
    turns = np.array([[winding_number(ring, x + half, y + half) for x in range(13)] for y in range(12)])
    np.testing.assert_array_equal(filled(ring), turns != 0)
    canvas = np.zeros((12, 13), dtype=np.int32)
    low, high = min(0, turns.min()), max(0, turns.max())
    assert fill_ring(canvas, ring, 1).crosses_itself == (high - low > 1)


coordinates = st.floats(0, 12)


@given(st.lists(st.tuples(coordinates, st.floats(0.1, 5)), min_size=1, max_size=6))
def test_polygons_sharing_a_border_share_every_pixel_out(steps: list[tuple[float, float]]) -> None:
    """A border running down the picture, at any floats, cuts a frame around it in two."""
    border = [(x, y) for x, y in zip([s[0] for s in steps], np.cumsum([s[1] for s in steps]), strict=True)]
    border = [(border[0][0], -9.0), *border, (border[-1][0], 99.0)]
    left = np.array([*border, (-9, 99), (-9, -9)], dtype=float)
    right = np.array([*border, (99, 99), (99, -9)], dtype=float)
    assert (filled(left) + filled(right) == 1).all()


def test_direction_and_closing_vertex_do_not_matter() -> None:
    ring = np.array([(1.2, 1.7), (10.1, 2.3), (7.4, 9.9)])
    expected = filled(ring)
    np.testing.assert_array_equal(filled(ring[::-1]), expected)
    np.testing.assert_array_equal(filled(np.vstack([ring, ring[:1]])), expected)


def test_a_pixel_belongs_where_its_centre_is() -> None:
    canvas = filled(np.array([(2.5, 3.5), (5.5, 3.5), (5.5, 6.5), (2.5, 6.5)]))
    expected = np.zeros((12, 13), dtype=np.int32)
    expected[3:6, 2:5] = 1
    np.testing.assert_array_equal(canvas, expected)


def test_overlapping_loops_stay_filled() -> None:
    loop = [(1, 1), (9, 1), (9, 9), (1, 9)]
    ring = np.array(loop + loop, dtype=float)
    canvas = np.zeros((12, 13), dtype=np.int32)
    assert fill_ring(canvas, ring, 1) == (64, True)


@pytest.mark.parametrize("far", [1e7, 1e18, 1e300])
def test_far_away_vertices_do_no_harm(far: float) -> None:
    ring = np.array([(-far, -far), (far, -far), (far, far), (-far, far)])
    assert filled(ring).all()
