"""Borders that annotators drew a little beside the picture's edges."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec import Annotations, InputError, Options, Shape, vectorize

EDGE, DRAWN = 30, 32
"""Where the picture changes colour, and where the border was drawn: pixels from the left."""


def border_position(options: Options) -> float:
    """Where the border between the two regions runs in the vector image, pixels from the left."""
    pixels = np.full((40, 60, 3), 60, np.uint8)
    pixels[:, EDGE:] = 180
    halves = [(0.0, DRAWN), (DRAWN, 60.0)]
    shapes = tuple(
        Shape(name, rings=(np.array([(left, 0), (right, 0), (right, 40), (left, 40)], float),))
        for name, (left, right) in zip(("left", "right"), halves, strict=True)
    )
    image = vectorize(pixels, Annotations(shapes), options)
    (border,) = (curve for curve in image.curves if not curve.on_frame)
    return float(border.control_points[:, 0].mean())


def test_annotated_borders_move_onto_edges() -> None:
    assert border_position(Options()) == pytest.approx(EDGE, abs=0.25)


def test_snap_0_keeps_borders_as_they_were_drawn() -> None:
    assert border_position(Options(snap=0)) == pytest.approx(DRAWN, abs=0.51)


def test_borders_move_no_further_than_snap() -> None:
    assert border_position(Options(snap=1)) >= DRAWN - 2


@pytest.mark.parametrize("snap", [-1, 20.5, float("nan"), float("inf")])
def test_snap_has_bounds(snap: float) -> None:
    with pytest.raises(InputError, match="snap") as refused:
        Options(snap=snap)
    assert (refused.value.code, refused.value.pointer) == ("bad-option", "snap")
