"""Borders that annotators drew a little beside the picture's edges."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from skimage.segmentation import watershed

from gcvec import Annotations, InputError, Options, Shape, vectorize
from gcvec.regions.snap import snap_borders
from tests.gcvec.scenes import SCENES

EDGE, DRAWN = 30, 32
"""Where the picture changes colour, and where the border was drawn: pixels from the left."""


def border_position(options: Options, edge: int = EDGE) -> float:
    """Where the border between the two regions runs in the vector image, pixels from the left."""
    pixels = np.full((40, 60, 3), 60, np.uint8)
    pixels[:, edge:] = 180
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


def test_snap_bounds_how_far_borders_move() -> None:
    """First by whole pixels and then, as far again, between them."""
    edge = DRAWN - 4
    assert border_position(Options(snap=4), edge) == pytest.approx(edge, abs=0.25)
    assert border_position(Options(snap=1), edge) >= DRAWN - 2


@pytest.mark.parametrize("snap", [-1, 20.5, float("nan"), float("inf")])
def test_snap_has_bounds(snap: float) -> None:
    with pytest.raises(InputError, match="snap") as refused:
        Options(snap=snap)
    assert (refused.value.code, refused.value.pointer) == ("bad-option", "snap")


def snap_slowly(labels: np.ndarray, picture: np.ndarray, band: float) -> np.ndarray:
    """The same with distances, gradients and floods over the whole picture."""
    border = np.zeros(labels.shape, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            shifted = np.roll(labels, step, axis)
            edge = np.arange(labels.shape[axis]) == (0 if step == 1 else labels.shape[axis] - 1)
            border |= (shifted != labels) & ~(edge[:, None] if axis == 0 else edge[None])
    depth = ndimage.distance_transform_edt(~border) + 0.5
    deepest = np.asarray(ndimage.maximum(depth, labels, np.arange(labels.max() + 1)))
    seeds = np.where(depth > np.minimum(band, deepest[labels] - 1e-9), labels + 1, 0)
    gradient = sum(ndimage.gaussian_gradient_magnitude(picture[..., c], 0.7) for c in range(3))
    return np.asarray(watershed(gradient, seeds) - 1)


@pytest.mark.parametrize("band", [0.4, 1.0, 2.5, 6.0])
@pytest.mark.parametrize("scene", ["ring", "voronoi", "stripes", "diagonal"])
def test_snapping_equals_a_watershed_of_the_whole_picture(scene: str, band: float) -> None:
    labels = SCENES[scene].labels
    picture = ndimage.gaussian_filter(np.random.default_rng(4).random((*labels.shape, 3)), (1, 1, 0))
    found = snap_borders(labels, picture, band)
    np.testing.assert_array_equal(found, snap_slowly(labels, picture, band))
    assert (found != labels).any() == (band > 0.5)
