"""Corners of chains of samples, against numpy's fits and where the truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders import corners as module
from gcvec.borders.border import Borders, sample_borders
from gcvec.borders.chains import Chains
from gcvec.borders.corners import (
    GAP,
    LEAST_GAIN,
    LEAST_TURN,
    SIDES,
    SURE_ERROR,
    UNSURE_ERROR,
    _cut,
    _lattice_point,
    corner_gains,
    corners,
)
from gcvec.borders.localize import localized
from gcvec.borders.planar_graph import planar_graph
from tests.gcvec.borders.walks import assert_whole
from tests.gcvec.scenes import SCENES, Scene

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


def ring_and_cross() -> Borders:
    """Four regions that meet in one node, and a fifth inside one of them, whose border is closed."""
    labels = np.zeros((40, 44), np.int32)
    labels[:20, 22:], labels[20:, :22], labels[20:, 22:] = 1, 2, 3
    labels[25:35, 28:38] = 4
    return sample_borders(planar_graph(labels), 44, 40)


def half_way(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray((a + b) / 2)


@pytest.mark.parametrize("cuts", [[3], [3, 11], [0, 16, 17]])
@pytest.mark.parametrize("closed", [False, True])
def test_pieces_of_a_border_are_the_border(closed: bool, cuts: list[int]) -> None:
    """Its samples in order, none twice, with a node, which nobody knows for sure, where it was cut."""
    before = ring_and_cross()
    k = next(k for k, b in enumerate(before.borders) if not b.on_frame and b.closed == closed)
    border = before.borders[k]
    after = _cut(before, {k: cuts}, half_way)
    assert_whole(after)
    pieces = after.borders[k : k + len(cuts) + (not closed)]
    assert len(after.borders) == len(before.borders) + len(pieces) - 1
    assert len(after.nodes) == len(before.nodes) + len(cuts)
    assert all((p.left, p.right) == (border.left, border.right) for p in pieces)
    walked = np.concatenate([piece.samples[1:-1] for piece in pieces])
    own = np.roll(border.samples[:-1], -cuts[0] - 1, axis=0) if closed else border.samples[1:-1]
    np.testing.assert_array_equal(walked, own)
    places = {tuple(half_way(border.samples[c], border.samples[c + 1])) for c in cuts}
    between = [piece.samples[0] for piece in pieces[(not closed) :]]
    assert {tuple(place) for place in between} == places
    assert all(piece.trust[[0, -1]].tolist() == [0, 0] and (piece.trust[1:-1] == 1).all() for piece in pieces)


def test_borders_without_corners_stay_as_they_are() -> None:
    before = ring_and_cross()
    after = _cut(before, {}, half_way)
    for a, b in zip(before.borders, after.borders, strict=True):
        assert a.samples is b.samples
        assert (a.start, a.end) == (b.start, b.end)
    np.testing.assert_array_equal(before.nodes, after.nodes)


@pytest.mark.parametrize("scene", ["voronoi", "stripes"])
def test_between_two_cracks_lies_the_lattice_point_that_they_share(scene: str) -> None:
    for arc in planar_graph(SCENES[scene].labels).arcs:
        middles = (arc.points[1:] + arc.points[:-1]) / 2
        for k in range(len(middles) - 1):
            np.testing.assert_array_equal(_lattice_point(middles[k], middles[k + 1]), arc.points[k + 1])


@pytest.mark.parametrize(("radius", "expected"), [(0.0, 8), (6.0, 0)])
def test_corners_are_those_that_the_photo_shows(radius: float, expected: int) -> None:
    """A label map shows squares with rounded corners nearly as it does sharp ones. Here are two."""

    def owner(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        x = x % 64
        u, v = (np.abs(0.96 * x + 0.28 * y - 40), np.abs(0.96 * y - 0.28 * x - 24))
        return np.asarray(np.hypot(*(np.maximum(w - 20 + radius, 0) for w in (u, v))) <= radius).astype(int)

    squares = Scene(72, 128, owner)
    traced = sample_borders(planar_graph(squares.labels), 128, 72)
    for found in localized(traced, squares.picture() / 255.0):
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
    found = corners(chains, nowhere, np.ones(len(nowhere)), np.zeros((8, 8, 3)))
    assert found.tolist() == expected
    assert len(expected) > 3
