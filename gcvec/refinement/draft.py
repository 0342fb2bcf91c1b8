"""From refined unknowns to the file and back: what a run hands out is what a decoder sees."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.file import encode_rounded
from gcvec.colors.color_fit import ColorFit
from gcvec.metrics import squared_error
from gcvec.patches.canonical import Canvas
from gcvec.quantization import Quantization
from gcvec.refinement.scene import Scene
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Draft:
    """A file, and how it came about.

    image  what it holds
    mse    the mean squared error of its picture (0-255 scale)
    tried  (patches,) how many control points each region had before those that did not pay were taken back
    """

    data: bytes
    image: VectorImage
    mse: float
    tried: Ints

    @property
    def steps(self) -> Quantization:
        return self.image.quantization


def image_of(canvas: Canvas, points: Ints, colors: Floats, scene: Scene, steps: Quantization) -> VectorImage:
    """What is to be stored in these steps: a canvas with control points `(n, 2)`, by rows, and all colours
    `(b + n, 3)`."""
    foundation, n_boundary = canvas.foundation, canvas.foundation.space.size
    image = VectorImage(
        foundation.network,
        foundation.hard,
        colors[:n_boundary],
        points,
        colors[n_boundary:],
        scene.names,
        steps,
    )
    # A decoder lays the same foundation and canvas again.
    return image.knowing(canvas)


def drafted(image: VectorImage, scene: Scene, fit: ColorFit | None = None) -> Draft:
    """The file for a vector image of a scene, rounded to a `fit` if it is given."""
    data, boundary_colors, point_colors = encode_rounded(image, fit)
    rounded = replace(image, boundary_colors=boundary_colors, point_colors=point_colors)
    found = rounded.knowing(image.canvas, data)
    tried = np.bincount(found.patch_of_points, minlength=len(found.network.loops))
    return Draft(data, found, float(squared_error(found.picture, scene.pixels).mean()), tried)


def by_rows(points: Ints) -> Ints:
    """The order in which a file keeps control points `(n, 2)`."""
    return np.lexsort((points[:, 0], points[:, 1]))
