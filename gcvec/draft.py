"""From refined unknowns to the file and back: what a run hands out is what a decoder sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.canonical import Foundation
from gcvec.codec import decode, encode
from gcvec.quantization import Quantization
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Draft:
    """What a file needs beside curves, points and colours: hard curves `(c,) bool`, labels, and steps."""

    hard: NDArray[np.bool_]
    labels: tuple[str, ...]
    steps: Quantization

    def file(self, foundation: Foundation, points: Ints, colors: Floats) -> tuple[bytes, VectorImage]:
        """The file, and the vector image it holds, for points `(n, 2)` and all unknown colours `(b + n,
        3)`."""
        n_boundary = foundation.space.size
        order = np.lexsort((points[:, 0], points[:, 1]))
        data = encode(
            VectorImage(
                foundation.network,
                self.hard,
                colors[:n_boundary],
                points[order],
                colors[n_boundary:][order],
                self.labels,
                self.steps,
            )
        )
        return data, decode(data)


def measured_mse(image: VectorImage, pixels: NDArray[np.uint8]) -> float:
    """Mean squared error of the rendered picture against the photo `(h, w, 3) uint8`."""
    return float(((image.render().astype(np.float64) - pixels) ** 2).mean())
