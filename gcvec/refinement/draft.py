"""From refined unknowns to the file and back: what a run hands out is what a decoder sees."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.file import encode_rounded
from gcvec.metrics import squared_error
from gcvec.patches.canonical import Canvas
from gcvec.quantization import Quantization
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def drafted(
    canvas: Canvas, points: Ints, colors: Floats, labels: tuple[str, ...], steps: Quantization
) -> tuple[bytes, VectorImage]:
    """The file in these steps, and the vector image it holds, for a canvas with control points `(n, 2)`, by
    rows, and all unknown colours `(b + n, 3)`; `labels` are those of the regions."""
    foundation, n_boundary = canvas.foundation, canvas.foundation.space.size
    image = VectorImage(
        foundation.network,
        foundation.hard,
        colors[:n_boundary],
        points,
        colors[n_boundary:],
        labels,
        steps,
    )
    # A decoder lays the same foundation and canvas again.
    data, boundary_colors, point_colors = encode_rounded(image.knowing(canvas))
    image = replace(image, boundary_colors=boundary_colors, point_colors=point_colors)
    return data, image.knowing(canvas, data)


def by_rows(points: Ints) -> Ints:
    """The order in which a file keeps control points `(n, 2)`."""
    return np.lexsort((points[:, 0], points[:, 1]))


def measured_mse(image: VectorImage, pixels: NDArray[np.uint8]) -> float:
    """Mean squared error of the rendered picture against the photo `(h, w, 3) uint8`."""
    return float(squared_error(image.picture, pixels).mean())
