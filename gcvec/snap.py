"""Annotated borders → image edges: a watershed on the gradient inside a narrow band along the borders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from skimage.segmentation import watershed

Floats = NDArray[np.float64]


def snap_borders(labels: NDArray[np.int32], picture: Floats, band: float) -> NDArray[np.int32]:
    """The label map `(h, w) int32` with every border moved by at most `band` pixels onto the image's edges.

    `picture` is `(h, w, 3)` in [0, 1]. Regions without a pixel outside the band keep the middle of theirs,
    so none is lost.
    """
    if band <= 0 or labels.min() == labels.max():
        return labels
    border = np.zeros(labels.shape, bool)
    horizontal, vertical = labels[:, 1:] != labels[:, :-1], labels[1:] != labels[:-1]
    border[:, 1:] |= horizontal
    border[:, :-1] |= horizontal
    border[1:] |= vertical
    border[:-1] |= vertical
    # Distance from the border itself, which runs half a pixel beside these pixels.
    depth = ndimage.distance_transform_edt(~border) + 0.5
    deepest = ndimage.maximum(depth, labels, np.arange(labels.max() + 1))
    seeds = np.where(depth > np.minimum(band, np.asarray(deepest)[labels] - 1e-9), labels + 1, 0)
    gradient = sum(ndimage.gaussian_gradient_magnitude(picture[..., c], 0.7) for c in range(3))
    return np.asarray(watershed(gradient, seeds) - 1, np.int32)
