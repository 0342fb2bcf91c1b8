"""The picture as an indexed triangle mesh, the form that file formats and graphics cards take."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.vector_image import VectorImage

SCALE = 4.0
"""Exported triangles follow the curves closely enough for drawing at this scale."""


@dataclass(frozen=True)
class Triangles:
    """Gouraud triangles; a place on a hard edge has one vertex for each of its colours.

    positions  (v, 2) float64, pixels, y down
    colors     (v, 3) float64 in [0, 1], sRGB
    corners    (t, 3) int64
    places     (v,) int64, equal for vertices at the same position
    """

    positions: NDArray[np.float64]
    colors: NDArray[np.float64]
    corners: NDArray[np.int64]
    places: NDArray[np.int64]


def drawn_triangles(image: VectorImage, scale: float = SCALE) -> Triangles:
    """All triangles of the picture, flat enough for drawing at `scale`."""
    vertices, triangles, colors, corner_color = image.gouraud(scale)
    pairs, corners = np.unique(triangles.astype(np.int64) * len(colors) + corner_color, return_inverse=True)
    places, color = np.divmod(pairs, len(colors))
    return Triangles(vertices[places], np.clip(colors[color], 0, 1), corners.reshape(-1, 3), places)
