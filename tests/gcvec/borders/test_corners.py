"""Corners of chains of samples, against numpy's fits and where the truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders import corners as module
from gcvec.borders.border import sample_borders
from gcvec.borders.chains import Chains
from gcvec.borders.corners import (
    FARTHEST,
    GAP,
    LEAST_GAIN,
    LEAST_TURN,
    SIDES,
    SURE_ERROR,
    UNSURE_ERROR,
    _at_apexes,
    corner_gains,
    corners,
)
from gcvec.borders.localize import localized
from gcvec.borders.planar_graph import planar_graph
from tests.gcvec.borders.walks import assert_whole
from tests.gcvec.scenes import Scene

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


@pytest.mark.parametrize(("radius", "expected"), [(0.0, 8), (6.0, 0)])
def test_corners_are_those_that_the_photo_shows(radius: float, expected: int) -> None:
    """A label map shows squares with rounded corners nearly as it does sharp ones. Here are two."""

    def owner(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x = x % 64
        u, v = (np.abs(0.96 * x + 0.28 * y - 40), np.abs(0.96 * y - 0.28 * x - 24))
        return np.asarray(np.hypot(*(np.maximum(w - 20 + radius, 0) for w in (u, v))) <= radius).astype(int)

    squares = Scene(72, 128, owner)
    traced = sample_borders(planar_graph(squares.labels), 128, 72)
    for found in localized(traced, squares.labels, squares.picture() / 255.0):
        assert_whole(found)
        inside = ((found.nodes > 0) & (found.nodes < [128, 72])).all(axis=1)
        assert inside.sum() == expected


@pytest.mark.parametrize("seed", range(3))
def test_of_corners_close_together_the_sharpest_counts(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    """Of equally sharp ones the first. Each gains what it does at its best scale."""
    sizes, closed = (40, 9, 60, 5), (False, False, True, True)
    offsets = np.cumsum([0, *sizes])
    nodes = np.where(np.array(closed)[:, None], -1, np.arange(8).reshape(4, 2))
    chains = Chains(np.arange(4), np.array(closed), nodes, offsets)
    gains = np.random.default_rng(seed).integers(0, 9, (len(SIDES), offsets[-1])) * (LEAST_GAIN / 5)
    nowhere = np.zeros((offsets[-1], 2))
    monkeypatch.setattr(module, "corner_gains", lambda *a: (gains[SIDES.index(a[-1])], nowhere, nowhere))
    expected = []
    for first, size, round_ in zip(offsets, sizes, closed, strict=False):
        best = gains[:, first : first + size].max(axis=0)
        for k in range(size):
            reach = range(1, SIDES[0] + 1)
            steps = [d for d in reach if not round_ or 2 * d < size]
            before = [best[(k - d) % size] for d in steps if round_ or k >= d]
            after = [best[(k + d) % size] for d in steps if round_ or k + d < size]
            if best[k] >= max([LEAST_GAIN, *after]) and best[k] > max(before, default=0):
                expected.append(first + k)
    monkeypatch.setattr(module, "_at_apexes", lambda chains, points, found, apex: found)
    found = corners(chains, nowhere, np.ones(len(nowhere)), np.zeros((8, 8, 3)))
    assert np.asarray(found).tolist() == expected
    assert len(expected) > 3


@pytest.mark.parametrize("angle", [1.2, 1.6, 2.4])
@pytest.mark.parametrize("closed", [False, True])
def test_a_corner_is_where_its_sides_meet(angle: float, closed: bool) -> None:
    """Whatever sample saw it best; the last before the apex, which lies on the 16th, is the 15th or 16th."""
    points = wedge(angle, 15, 0.01, 0)
    n = len(points)
    nodes = np.array([[-1, -1]] if closed else [[0, 1]])
    made = Chains(np.arange(1), np.array([closed]), nodes, np.array([0, n]))
    for k in range(12, 19):
        after, places = _at_apexes(made, points, np.array([k, 16]), np.array([[40.0, 30.0]] * 2))
        assert len(after) == 1
        assert after[0] in (14, 15)
        assert places.tolist() == [[40, 30]]


def test_a_corner_far_from_its_border_is_on_the_border() -> None:
    points = wedge(1.6, 15, 0, 0)
    made = Chains(np.arange(1), np.array([False]), np.array([[0, 1]]), np.array([0, len(points)]))
    after, places = _at_apexes(made, points, np.array([15]), np.array([[40.0, 29.5 - FARTHEST]]))
    np.testing.assert_array_equal(places, (points[after] + points[after + 1]) / 2)


def test_no_node_is_taken_for_a_corner() -> None:
    """An open border of six samples is cut between its inner ones, however near the apex is to its end."""
    points = np.stack([np.arange(6.0), np.zeros(6)], axis=1)
    made = Chains(np.arange(1), np.array([False]), np.array([[0, 1]]), np.array([0, 6]))
    for x in (-3.0, 8.0):
        after, _ = _at_apexes(made, points, np.array([2]), np.array([[x, 0.0]]))
        assert after.tolist() == [1 if x < 0 else 3]
