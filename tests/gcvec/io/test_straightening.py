"""Staircases as straight lines, against a search that tries every way."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcvec.io.straightening import straightened

EAST, SOUTH, WEST, NORTH = (1, 0), (0, 1), (-1, 0), (0, -1)


def arc(*runs: tuple[tuple[int, int], int]) -> np.ndarray:
    """Lattice points from (0, 0) on, so many steps in each direction."""
    steps = [step for step, n in runs for _ in range(n)]
    return np.cumsum([(0, 0), *steps], axis=0).astype(np.int32)


# Monotone to the south-east: never over itself.
staircases = st.lists(st.tuples(st.sampled_from([EAST, SOUTH]), st.integers(1, 4)), min_size=1, max_size=6)


def candidates(points: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Where vertices may be, as (steps along the arc, place): its ends, its turns, and half-way between."""
    steps = np.diff(points, axis=0)
    turns = [k for k in range(1, len(steps)) if (steps[k] != steps[k - 1]).any()]
    stops = [0, *turns, len(steps)]
    along = sorted({*map(float, stops), *((a + b) / 2 for a, b in pairwise(stops))})
    return [(t, points[int(t)] + (t % 1) * steps[min(int(t), len(steps) - 1)]) for t in along]


def keeps_centres(points: np.ndarray, a: tuple[float, np.ndarray], b: tuple[float, np.ndarray]) -> bool:
    """Whether the line passes between the centres at both sides of every edge whose middle it replaces."""
    way = b[1] - a[1]
    for k, step in enumerate(np.diff(points, axis=0)):
        if a[0] < k + 0.5 < b[0]:
            middle, left = points[k] + step / 2, np.array([step[1], -step[0]]) / 2
            sides = [np.linalg.det([way, centre - a[1]]) for centre in (middle + left, middle - left)]
            if not sides[0] < 0 < sides[1]:
                return False
    return True


def off(points: np.ndarray, a: tuple[float, np.ndarray], b: tuple[float, np.ndarray]) -> float:
    """Squared distances of the line from the middles of the edges that it replaces."""
    normal = np.array([-(b[1] - a[1])[1], (b[1] - a[1])[0]]) / np.hypot(*(b[1] - a[1]))
    middles = (points[1:] + points[:-1]) / 2
    own = [k for k in range(len(middles)) if a[0] < k + 0.5 < b[0]]
    return float(sum(((middles[k] - a[1]) @ normal) ** 2 for k in own))


def best_ways(points: np.ndarray) -> tuple[int, float]:
    """How many lines are needed, and the least squared distance with so many."""
    places = candidates(points)
    best = [(0, 0.0)] + [(len(places), np.inf)] * (len(places) - 1)
    for b in range(1, len(places)):
        for a in range(b):
            if keeps_centres(points, places[a], places[b]):
                best[b] = min(best[b], (best[a][0] + 1, best[a][1] + off(points, places[a], places[b])))
    return best[-1]


def walked(points: np.ndarray, found: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """The vertices as candidates, which they have to be, in order."""
    places = candidates(points)
    chosen = [next(c for c in places if (c[1] == vertex).all()) for vertex in found]
    assert [t for t, _ in chosen] == sorted({t for t, _ in chosen})
    return chosen


@settings(max_examples=50)
@given(staircases.map(lambda runs: arc(*runs)))
def test_no_way_has_fewer_lines_or_as_many_closer_ones(points: np.ndarray) -> None:
    found = straightened(points)
    np.testing.assert_array_equal(found[[0, -1]], points[[0, -1]])
    lines = list(pairwise(walked(points, found)))
    assert all(keeps_centres(points, a, b) for a, b in lines)
    n, least = best_ways(points)
    assert len(lines) == n
    assert sum(off(points, a, b) for a, b in lines) == pytest.approx(least, abs=1e-9)


def test_a_square_keeps_its_corners() -> None:
    points = arc((EAST, 5), (SOUTH, 5), (WEST, 5), (NORTH, 5))
    np.testing.assert_array_equal(straightened(points), [[0, 0], [5, 0], [5, 5], [0, 5], [0, 0]])


def test_both_directions_have_as_many_lines() -> None:
    points = arc((EAST, 3), (SOUTH, 1), (EAST, 2), (SOUTH, 2), (EAST, 1), (SOUTH, 4), (WEST, 2))
    assert len(straightened(points)) == len(straightened(np.ascontiguousarray(points[::-1])))
