"""What localising does along chains of samples, against the same chain by chain."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders.chains import Chains
from gcvec.borders.fairing import OVERLAP, STIFFNESS, faired
from gcvec.borders.localize import (
    DOUBT,
    NEIGHBOURS,
    REMOTE,
    SHADING,
    _nearest_other,
    _running_median,
    _spread,
)


def chains(sizes: tuple[int, ...], closed: tuple[bool, ...]) -> Chains:
    n = len(sizes)
    nodes = np.where(np.array(closed)[:, None], -1, np.arange(2 * n).reshape(n, 2))
    return Chains(np.arange(n), np.array(closed), nodes, np.cumsum([0, *sizes]))


MADE = chains((40, 9, 60, 3), (False, False, True, True))


def neighbours(k: int, size: int, closed: bool, reach: int) -> list[int]:
    around = range(k - reach, k + reach + 1)
    return [i % size if closed else i for i in around if closed or 0 <= i < size]


def test_running_median() -> None:
    rng = np.random.default_rng(0)
    values = np.where(rng.random(112) < 0.3, np.nan, rng.normal(size=112))
    values[:8] = np.nan
    found = _running_median(values, MADE.offsets, MADE.closed)
    assert (found == 0).sum() >= 2
    for first, end, closed in zip(MADE.offsets[:-1], MADE.offsets[1:], MADE.closed, strict=True):
        size = end - first
        for k in range(size):
            round_ = bool(closed) and size > 2 * SHADING
            near = values[first + np.array(neighbours(k, size, round_, SHADING))]
            known = np.sort(near[np.isfinite(near)])
            expected, n = 0.0, len(known)
            if n > SHADING:
                middle, spread = known[(n - 1) // 2], known[3 * n // 4] - known[n // 4]
                expected = middle / (1 + DOUBT * spread**2 / n / middle**2)
            assert found[first + k] == pytest.approx(expected, abs=1e-9)


def test_trust_spreads_from_the_best_neighbour() -> None:
    trust = np.random.default_rng(1).random(112)
    found = _spread(trust, MADE.offsets, MADE.closed)
    for first, end, closed in zip(MADE.offsets[:-1], MADE.offsets[1:], MADE.closed, strict=True):
        for k in range(end - first):
            near = first + np.array(neighbours(k, end - first, bool(closed), NEIGHBOURS))
            assert found[first + k] == trust[near].max()


@pytest.mark.parametrize("n", [2, 3, 50, 400])
def test_nearest_other_node(n: int) -> None:
    nodes = np.random.default_rng(n).integers(0, 40, (n, 2)).astype(float)
    distance = np.hypot(*(nodes[:, None] - nodes[None]).T)
    np.fill_diagonal(distance, np.inf)
    nearest = distance.min(axis=1)
    np.testing.assert_allclose(_nearest_other(nodes), np.where(nearest < REMOTE, nearest, np.inf))


def test_one_node_has_no_neighbour() -> None:
    assert _nearest_other(np.zeros((1, 2))).tolist() == [np.inf]


def test_fairing_minimises_what_it_says() -> None:
    rng = np.random.default_rng(2)
    made = chains((30, 50), (False, True))
    points, weight = rng.normal(size=(80, 2)), rng.uniform(0.01, 1, 80)
    found = faired(made, points, weight)
    for first, end, closed in ((0, 30, False), (30, 80, True)):
        n = end - first
        second = np.zeros((n if closed else n - 2, n))
        for row, k in enumerate(range(n) if closed else range(1, n - 1)):
            second[row, [(k - 1) % n, k, (k + 1) % n]] += [1, -2, 1]
        own = weight[first:end] + 1e-6
        if not closed:
            own[[0, -1]] = 1e6
        matrix = np.diag(own) + STIFFNESS * second.T @ second
        expected = np.linalg.solve(matrix, own[:, None] * points[first:end])
        # Closed chains are cut open a few samples further on.
        np.testing.assert_allclose(found[first:end], expected, atol=2e-3 if closed else 1e-6)
    assert OVERLAP >= 16
