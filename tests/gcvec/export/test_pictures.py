"""Pictures about a vector image."""

from __future__ import annotations

import numpy as np

from gcvec import Annotations, Options, Shape, VectorImage, vectorize
from gcvec.edit import Move, edit
from gcvec.export import patch_overlay
from gcvec.export.pictures import OUTLINE

SCALE = 4


def bar() -> VectorImage:
    """Two regions whose common border runs straight down the middle."""
    pixels = np.full((40, 60, 3), 40, np.uint8)
    pixels[:, 30:] = 200
    left = np.array([[0, 0], [30, 0], [30, 40], [0, 40]], float)
    right = np.array([[30, 0], [60, 0], [60, 40], [30, 40]], float)
    return vectorize(pixels, Annotations((Shape("left", (left,)), Shape("right", (right,)))), Options())


def outline_columns(image: VectorImage) -> np.ndarray:
    """Where outlines cross the middle row, pixels of the picture; those on the frame left out."""
    row = patch_overlay(image, SCALE)[20 * SCALE]
    columns = np.flatnonzero((row == OUTLINE).all(axis=1)) / SCALE
    return columns[(columns > 2) & (columns < 58)]


def test_outlines_lie_where_the_curves_are() -> None:
    assert np.abs(outline_columns(bar()) - 30).max() < 0.5


def test_outlines_follow_the_curves_that_an_edit_has_moved() -> None:
    image = bar()
    border = next(number for number, curve in enumerate(image.curves) if not curve.on_frame)
    count = len(image.curves[border].control_points)
    moved = edit(image, [Move(border, index, 6, 0) for index in range(count)])
    for version in (moved, VectorImage.from_bytes(moved.to_bytes())):
        assert np.abs(outline_columns(version) - 36).max() < 0.5
