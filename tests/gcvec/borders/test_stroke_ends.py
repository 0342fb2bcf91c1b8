"""Ends of strokes: found where they are, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders.border import sample_borders
from gcvec.borders.chains import Chains
from gcvec.borders.localize import localized
from gcvec.borders.planar_graph import planar_graph
from gcvec.borders.stroke_ends import LARGEST_WIDTH, NEAR, stroke_ends
from tests.gcvec.scenes import Scene

CENTER = np.array([30.2, 24.7])


def bar(angle: float, width: float, length: float) -> tuple[Scene, np.ndarray]:
    """A bar before a background, and its corners `(4, 2)`."""
    along = np.array([np.cos(angle), np.sin(angle)])
    across = np.array([-along[1], along[0]])

    def owner(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        xy = np.stack([x, y], axis=-1) - CENTER
        return np.asarray((abs(xy @ along) < length / 2) & (abs(xy @ across) < width / 2)).astype(int)

    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return Scene(50, 60, owner), CENTER + signs * [length / 2, width / 2] @ np.stack([along, across])


def row(points: np.ndarray, closed: bool) -> Chains:
    nodes = np.array([[-1, -1] if closed else [0, 1]])
    return Chains(np.arange(1), np.array([closed]), nodes, np.array([0, len(points)]))


def outline(length: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """The mid-points `(n, 2)` of the cracks around a bar of pixels that begins at (10, 10), and a picture."""
    x, y = np.arange(length) + 0.5, np.arange(width) + 0.5
    top, right = np.stack([x, 0 * x], axis=1), np.stack([0 * y + length, y], axis=1)
    around = np.concatenate([top, right, [length, width] - top, [0, width] - (right - [length, 0])])
    picture = np.full((50, 60, 3), 0.2)
    picture[10 : 10 + width, 10 : 10 + length] = 0.7
    return 10 + around, picture


@pytest.mark.parametrize("width", [2.0, 2.5, 3.0, 4.0])
@pytest.mark.parametrize("degrees", [0, 25, 45, 90])
def test_a_bar_keeps_its_four_corners(width: float, degrees: float) -> None:
    scene, corners = bar(np.deg2rad(degrees), width, 22.0)
    traced = sample_borders(planar_graph(scene.labels), scene.width, scene.height)
    _, placed = localized(traced, scene.labels, scene.picture() / 255.0)
    inside = placed.nodes[((placed.nodes > 0) & (placed.nodes < [60, 50])).all(axis=1)]
    assert len(inside) == 4
    away = np.hypot(*(inside[:, None] - corners).T)
    assert away.min(axis=0).max() < 0.45
    assert away.min(axis=1).max() < 0.45


@pytest.mark.parametrize("width", range(1, int(LARGEST_WIDTH) + 3))
@pytest.mark.parametrize("turn", [0, 3, 11])
def test_ends_of_closed_outlines(width: int, turn: int) -> None:
    """Both, wherever the outline begins, as long as they are short; between the samples next to them."""
    length = 14
    around, picture = outline(length, width)
    points = np.roll(around, -turn, axis=0)
    found = stroke_ends(row(points, True), points, picture, 0.0)
    expected = [(length, length + width), (2 * length + width, 2 * (length + width))] if width <= 5 else []
    n = len(points)
    begun = sorted((a - 1 - turn) % n for a, _ in expected)
    assert sorted(found.after[:, 0].tolist()) == begun
    for after, places in zip(found.after, found.places, strict=True):
        assert (after[1] - after[0]) % n == width
        for k, place in zip(after, places, strict=True):
            assert np.hypot(*(place - (points[k] + points[(k + 1) % n]) / 2)) < 0.6 < NEAR


def test_an_open_border_has_no_end_at_its_nodes() -> None:
    """Cut in the middle of a short side it has one end left, cut next to one it has none there."""
    points, picture = outline(14, 3)
    for turn, ends in ((15, 1), (0, 1), (7, 2), (12, 1)):
        own = np.roll(points, -turn, axis=0)
        assert len(stroke_ends(row(own, False), own, picture, 0.0).after) == ends


@pytest.mark.parametrize("radius", [2.5, 3.0, 4.0, 8.0])
def test_a_circle_has_no_ends(radius: float) -> None:
    n = int(2 * np.pi * radius)
    angle = np.arange(n) * 2 * np.pi / n
    points = 20 + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    y, x = np.mgrid[:50, :60] + 0.5
    picture = np.repeat((np.hypot(x - 20, y - 20) < radius)[..., None] * 0.5, 3, axis=2)
    assert len(stroke_ends(row(points, True), points, picture, 0.0).after) == 0


def test_the_picture_says_how_far_a_stroke_reaches() -> None:
    """No further than it may move borders."""
    scene, _ = bar(0.0, 4.0, 22.0)
    points = outline(22, 4)[0] + np.array([9, 13])
    true = CENTER[0] + 11
    for allowed, expected in ((1.0, true), (0.05, 41.05), (0.0, 41.0)):
        found = stroke_ends(row(points, True), points, scene.picture() / 255.0, allowed)
        right = found.places[found.places[:, 0, 0] > 30]
        np.testing.assert_allclose(right[0, :, 0], expected, atol=0.06)


@pytest.mark.parametrize("blur", [0, 4])
def test_a_stroke_that_fades_out_has_no_end(blur: int) -> None:
    """Where the picture shows no step, whatever the label map says."""
    points, picture = outline(14, 3)
    for k in range(blur):
        picture[10:13, [10 + k, 23 - k]] = 0.2 + 0.5 * (k + 1) / (blur + 3)
    assert len(stroke_ends(row(points, True), points, picture, 0.5).after) == (0 if blur else 2)
