"""What regions get for their points: the bargains of each are compared, and the better ones put together."""

from __future__ import annotations

import numpy as np

from gcvec.refinement.bargains import FEW_A_PIXEL, LEAST_RETURN, Bargains, bargains

AREAS = np.array([320, 320, 320])


def made(squares: list[float], n_points: list[int], color: float = 0.0) -> Bargains:
    """Bargains of three regions with so many points, all of one colour; their places tell regions apart."""
    region = np.repeat(np.arange(3), n_points)
    points = np.stack([np.arange(len(region)), region], axis=1)
    return bargains(np.array(squares), AREAS, points, np.full((len(region), 3), color), region)


def points_of(found: Bargains) -> list[int]:
    """How many points each region has, those of each lying where its own lie."""
    np.testing.assert_array_equal(found.points[:, 1], found.region)
    assert len(found.points) == len(found.colors)
    return np.bincount(found.region, minlength=3).tolist()


def test_the_error_is_weighed_against_a_small_power_of_the_points() -> None:
    """Few points count as if they were more."""
    found = made([2.0, 2.0, 3.0], [100, 1, 0])
    few = FEW_A_PIXEL * 320
    np.testing.assert_allclose(
        found.score, [2 * 100**LEAST_RETURN, 2 * few**LEAST_RETURN, 3 * few**LEAST_RETURN]
    )


def test_twice_the_points_are_worth_an_error_that_falls_by_more_than_the_power() -> None:
    before = made([1.0, 1.0, 1.0], [50, 50, 50])
    fallen = 2**-LEAST_RETURN
    after = made([0.99 * fallen, 1.01 * fallen, 1.0], [100, 100, 100])
    assert points_of(after.better_of(before)) == [100, 50, 50]


def test_some_regions_go_back_and_the_others_stay() -> None:
    now, before = made([1.0, 2.0, 3.0], [40, 50, 60], 0.1), made([4.0, 5.0, 6.0], [14, 15, 16], 0.9)
    found = now.except_in(np.array([False, True, False]), before)
    assert points_of(found) == [40, 15, 60]
    np.testing.assert_array_equal(found.score, [now.score[0], before.score[1], now.score[2]])
    np.testing.assert_array_equal(found.colors[:, 0], np.where(found.region == 1, 0.9, 0.1))


def test_without_anything_before_all_is_the_best() -> None:
    now = made([1.0, 2.0, 3.0], [4, 5, 6])
    assert now.better_of(None) is now


def test_of_equal_bargains_the_first_one_stays() -> None:
    now, before = made([1.0] * 3, [4] * 3, 0.1), made([1.0] * 3, [4] * 3, 0.9)
    assert set(now.better_of(before).colors[:, 0]) == {0.9}
