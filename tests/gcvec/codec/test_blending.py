"""Several predictions of a colour: that averages reach along their directions, and the better ones count."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.codec.blending import ALONG, blend, lean, look_back, sum_up
from gcvec.codec.former import NOT_ALONG
from gcvec.codec.neighborhoods import NEIGHBORS

DIRECTIONS = (1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1)
POINT = np.array([60, 55])
TOTAL = 82375
"""The weight of neighbours 1 and 2 pixels away."""


def around(n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Points, the last of which is `POINT`, and n of those before it as its neighbours."""
    rng = np.random.default_rng(seed)
    places = np.unique(np.stack([rng.integers(-48, 49, 99), rng.integers(-48, 0, 99)], axis=1), axis=0)
    near = rng.permutation(len(places))[:n].astype(np.int32)
    return np.concatenate([POINT + places, [POINT]]), near


@pytest.mark.parametrize("n", [0, 1, 3, NEIGHBORS])
def test_the_weights_of_averages(n: int) -> None:
    points, near = around(n)
    leaning = np.zeros((NEIGHBORS, len(DIRECTIONS)))
    lean(points, near, n, len(points) - 1, ALONG, leaning, np.zeros(len(DIRECTIONS)))
    for k, vector in enumerate(DIRECTIONS):
        along = (points[near] - POINT) @ vector
        aside = (points[near] - POINT) @ (-vector[1], vector[0])
        weights = 1.0 / (along**2 + (4 * aside) ** 2)
        np.testing.assert_allclose(leaning[:n, k], weights / weights.sum(), rtol=1e-12)


def blended(offers: list[float], errors: np.ndarray) -> float:
    """Of the first coordinate of a point with two neighbours whose errors `(2, o)` were such."""
    lanes = len(offers)
    history, sums = np.zeros((3, 3 * lanes)), np.zeros(3 * lanes)
    history[:2, :lanes] = errors
    near, closeness = np.array([1, 0], np.int32), np.array([65536, 16384])
    sum_up(near, closeness, TOTAL, 2, history, sums)
    value: float = blend(np.array(3 * offers), sums, np.zeros(3 * lanes), TOTAL, 0)
    return value


def test_a_single_prediction_is_taken_as_it_is() -> None:
    assert blended([0.1], np.zeros((2, 1))) == 0.1
    assert NOT_ALONG.shape[2] == 0


def test_predictions_that_were_equally_good_count_alike() -> None:
    assert blended([1.0, 3.0, 8.0], np.full((2, 3), 5.0)) == pytest.approx(4.0)


def test_the_better_prediction_counts_more() -> None:
    errors = np.array([[4.0, 1.0], [4.0, 1.0]])
    sums = [1500 + 0.2 * TOTAL + (65536 + 16384) * e for e in (4.0, 1.0)]
    votes = [s**-4 for s in sums]
    assert blended([0.0, 1.0], errors) == pytest.approx(votes[1] / sum(votes))
    assert blended([0.0, 1.0], errors) > 0.99


def test_errors_of_the_nearer_neighbor_weigh_more() -> None:
    assert blended([0.0, 1.0], np.array([[0.0, 4.0], [4.0, 0.0]])) > 0.9


def test_what_was_right_on_the_axes_before_counts_more() -> None:
    offers, sums, own = np.array([0.0, 1.0] * 3), np.full(6, 1e4), np.zeros(6)
    assert blend(offers, sums, own, TOTAL, 2) == pytest.approx(0.5)
    own[:4] = 9.0, 0.0, 4.0, 0.0
    bad = 1e4 + 0.1 * TOTAL * 13
    assert blend(offers, sums, own, TOTAL, 2) == pytest.approx(1 / (1 + (1e4 / bad) ** 4))


def test_errors_on_the_first_axis_count_on_the_others() -> None:
    own, offers = np.zeros(6), np.array([1.0, 4.0] * 3)
    look_back(offers, 2.0, own, 0)
    look_back(offers, 5.0, own, 2)
    np.testing.assert_allclose(own, [1.0, 4.0, 0.0, 0.0, 16.1, 1.4])
