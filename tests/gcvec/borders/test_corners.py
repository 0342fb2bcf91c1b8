"""Corners of chains of samples, against numpy's fits and where the truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders.corners import GAP, LEAST_TURN, SIDES, SURE_ERROR, UNSURE_ERROR, corner_gains

Fit = tuple[np.ndarray, np.ndarray, float]


def slow_line(points: np.ndarray) -> Fit:
    """Direction, middle, and squared distances left."""
    middle = points.mean(axis=0)
    _, sizes, directions = np.linalg.svd(points - middle)
    direction = directions[0] * (1 if directions[0] @ (points[-1] - points[0]) >= 0 else -1)
    return direction, middle, float(sizes[1] ** 2)


def slow_gain(before: np.ndarray, after: np.ndarray, sure: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Gain, apex and inward direction of a corner between two rows of samples."""
    u, a, left = slow_line(before)
    v, b, right = slow_line(after)
    error = (len(before) + len(after)) * (sure * SURE_ERROR**2 + (1 - sure) * UNSURE_ERROR**2)
    turn = np.arccos(np.clip(u @ v, -1, 1))
    if turn < LEAST_TURN or left + right > 4 * error:
        return 0.0, np.zeros(2), np.zeros(2)
    apex = a + np.linalg.solve(np.stack([u, -v], axis=1), b - a)[0] * u
    inward = (v - u) / np.hypot(*(v - u)) * np.cos(turn / 2)
    points = np.concatenate([before, after])
    way = (points[-1] - points[0]) / np.hypot(*(points[-1] - points[0]))
    s, d = points @ way, points @ np.array([-way[1], way[0]])
    bent = float(((np.polyval(np.polyfit(s, d, 2), s) - d) ** 2).sum())
    return bent / (left + right + error), apex, inward


def wedge(angle: float, n: int, noise: float, seed: int) -> np.ndarray:
    """Samples a pixel apart along two straight sides that meet in (40, 30)."""
    t = np.arange(-n, n + 1) + 0.5
    sides = np.where(t[:, None] < 0, [-1.0, 0.0], [np.cos(angle), np.sin(angle)]) * np.abs(t)[:, None]
    return np.array([40.0, 30.0]) + sides + np.random.default_rng(seed).normal(0, noise, (2 * n + 1, 2))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("closed", [False, True])
def test_gains_as_read_out_loud(side: int, closed: bool) -> None:
    rows = [wedge(0.9, 14, 0.1, 1), wedge(2.0, 20, 0.2, 2), wedge(1.2, 3, 0.1, 3)]
    points, offsets = np.concatenate(rows), np.cumsum([0, *map(len, rows)])
    trust = np.random.default_rng(side).random(len(points))
    gains, apexes, inward = corner_gains(points, trust, offsets, np.full(3, closed), side)
    assert (gains > 1).sum() > 4
    for first, end in zip(offsets[:-1], offsets[1:], strict=True):
        n = end - first
        for k in range(n):
            own = np.arange(k - GAP - side + 1, k - GAP + 1), np.arange(k + GAP + 1, k + GAP + side + 1)
            inside = closed or (own[0][0] > 0 and own[1][-1] < n - 1)
            expected = 0.0, np.zeros(2), np.zeros(2)
            if inside and not (closed and 2 * (GAP + side) >= n):
                before, after = (first + i % n for i in own)
                sure = trust[np.concatenate([before, after])].mean()
                expected = slow_gain(points[before], points[after], sure)
            found = gains[first + k], apexes[first + k], inward[first + k]
            for a, b in zip(found, expected, strict=True):
                np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("angle", [1.2, 1.8, 2.4])
def test_a_clean_corner_has_its_apex_where_the_sides_meet(angle: float) -> None:
    points = wedge(angle, 15, 0, 0)
    n = len(points)
    for side in SIDES:
        gains, apexes, _ = corner_gains(points, np.ones(n), np.array([0, n]), np.array([False]), side)
        best = int(gains.argmax())
        assert gains[best] > 3
        np.testing.assert_allclose(apexes[best], [40, 30], atol=0.4)


def test_a_smooth_arc_has_no_corner() -> None:
    angle = np.linspace(0, 2 * np.pi, 63)[:-1]
    points = 10 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for side in SIDES:
        gains, _, _ = corner_gains(points, np.ones(62), np.array([0, 62]), np.array([True]), side)
        assert gains.max() < 1
