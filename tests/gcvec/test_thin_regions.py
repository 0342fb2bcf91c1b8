"""Strokes and rings of two to four pixels: sharp at any zoom, without a crowd of control points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from PIL import Image

from gcvec import Annotations, Options, Shape, VectorImage, vectorize

WIDTH, HEIGHT, ZOOM = 120, 90, 4
LIGHT, DARK = 235.0, 30.0


BARS = [
    (13.3 + 23.2 * column, 12.4 + 21.7 * row, np.deg2rad(angle), width)
    for row, width in enumerate((2.0, 2.5, 3.0, 4.0))
    for column, angle in enumerate((0, 20, 45, 70, 90))
]
"""Middles, directions and widths of bars 16.4 pixels long."""

RINGS = ((40, 2.0), (33, 3.0), (26, 4.0), (17, 2.5))
"""Radii and widths of rings, one in the other."""


def bars(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    inside = np.zeros(x.shape, bool)
    for a, b, angle, width in BARS:
        along = (x - a) * np.cos(angle) + (y - b) * np.sin(angle)
        across = (y - b) * np.cos(angle) - (x - a) * np.sin(angle)
        inside |= (abs(along) < 8.2) & (abs(across) < width / 2)
    return inside


def rings(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    r = np.hypot(x - 60.3, y - 44.8)
    return np.any([(r < outer) & (r > outer - width) for outer, width in RINGS], axis=0)


def drawn_bars() -> Annotations:
    """Polygons as somebody draws them by hand: off by up to a third of a pixel."""
    rng = np.random.default_rng(2)
    shapes = []
    for a, b, angle, width in BARS:
        along, across = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        ways = [(-8.2, -width / 2), (8.2, -width / 2), (8.2, width / 2), (-8.2, width / 2)]
        ring = np.array([[a, b] + u * along + v * across for u, v in ways])
        shapes.append(Shape(label="bar", rings=(ring + rng.uniform(-0.3, 0.3, (4, 2)),)))
    return Annotations(tuple(shapes))


def drawn(inside: np.ndarray, pixels: int) -> np.ndarray:
    """The picture of a mask with so many samples along a pixel."""
    fine = np.where(inside, DARK, LIGHT)
    height, width = (n // pixels for n in fine.shape)
    return np.asarray(fine.reshape(height, pixels, width, pixels).mean(axis=(1, 3)))


def zoomed(scene: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """A photo `(h, w, 3) uint8` of the scene, and the truth at `ZOOM` times its size."""
    fine = 4 * ZOOM
    y, x = (np.mgrid[: HEIGHT * fine, : WIDTH * fine] + 0.5) / fine
    inside = scene(x, y)
    photo = np.round(drawn(inside, fine)).astype(np.uint8)
    return np.repeat(photo[..., None], 3, axis=2), drawn(inside, fine // ZOOM)


def decibels(made: VectorImage, photo: np.ndarray, truth: np.ndarray) -> float:
    """By how much the vector image is nearer to the truth than the photo made larger."""
    larger = Image.fromarray(photo).resize(truth.shape[::-1], Image.Resampling.LANCZOS)
    pictures = made.render(ZOOM), np.asarray(larger)
    ours, theirs = (((picture[..., 0] - truth) ** 2).mean() for picture in pictures)
    return float(10 * np.log10(theirs / ours))


def test_strokes_are_drawn_by_their_borders() -> None:
    photo, truth = zoomed(bars)
    made = vectorize(photo, drawn_bars(), Options(target_mse=5))
    report = made.report
    assert report is not None
    assert report.mse <= 5
    assert report.foldovers == 0
    assert report.patches == len(BARS) + 1
    assert report.points < 40
    assert decibels(made, photo, truth) > 12


def test_rings_are_drawn_by_their_borders() -> None:
    """Of regions found by themselves."""
    photo, truth = zoomed(rings)
    made = vectorize(photo, options=Options(target_mse=5))
    report = made.report
    assert report is not None
    assert report.mse <= 5
    assert report.foldovers == 0
    assert report.points < 100
    assert decibels(made, photo, truth) > 9
