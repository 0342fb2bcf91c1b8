"""How like our own render other programs draw an export."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy import ndimage

from gcvec import VectorImage
from gcvec.curves import bspline

SCALE = 2


def near_borders(image: VectorImage, scale: float = SCALE, distance: float = 3) -> NDArray[np.bool_]:
    """Pixels at `scale` within `distance` of a curve."""
    marked = np.zeros((round(image.height * scale), round(image.width * scale)), bool)
    for curve in image.network.curves:
        u = np.linspace(0, curve.segments, 200 * curve.segments)
        x, y = (bspline.evaluate(curve.control_points, u, curve.closed) * scale).astype(int).T
        marked[y.clip(0, len(marked) - 1), x.clip(0, marked.shape[1] - 1)] = True
    return np.asarray(ndimage.distance_transform_edt(~marked) <= distance)


def assert_faithful(drawn: NDArray[np.uint8], image: VectorImage) -> None:
    """`drawn`, at twice the picture's size, is the picture: in the mean, and without hairlines."""
    truth = image.render(SCALE).astype(int)
    assert drawn.shape == truth.shape
    off = np.abs(drawn - truth)
    assert off.mean() <= 1.5
    inside = ~near_borders(image)
    assert inside.mean() > 0.5
    assert (off.max(axis=2)[inside] > 24).mean() < 0.0005


def averaged(drawn: NDArray[np.uint8], times: int) -> NDArray[np.uint8]:
    """`times` by `times` pixels made one, for readers that do not sample at the middle of pixels."""
    height, width = drawn.shape[:2]
    return np.asarray(Image.fromarray(drawn).resize((width // times, height // times), Image.Resampling.BOX))
