"""Colours along hard edges, sampled on the curve and inside the region (paper, Fig. 6).

On the curve a photo shows a blend of both sides. Taken for the boundary's colour it spreads into the patch,
and interior control points have to repair it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from examples import figures
from examples.scenes import balls, vectorized_balls
from gcvec import raster
from gcvec.colors.boundary_color import color_samples, fit_boundary_colors
from gcvec.patches.canonical import Canvas, lay_canvas
from gcvec.refinement.paper import worst_pixels
from gcvec.refinement.scene import Scene, Terms
from gcvec.timing import StageClock
from gcvec.vector_image import to_8_bit

TERMS = Terms(target_mse=20.0, max_points=0)


def main() -> dict[str, float]:
    """Mean squared error of the patches without interior points, and the points the paper's loop needs."""
    image, picture = vectorized_balls(), balls().pixels / 255
    foundation = image.foundation
    samples = color_samples(image.network)
    labels = foundation.geometry.patch_at().astype(np.int32)
    result: dict[str, float] = {}
    row = []
    for name, hard in (("on the curve", np.zeros_like(image.hard)), ("inside", image.hard)):
        colors = fit_boundary_colors(image.network, foundation.space, hard, samples, picture, labels)
        bare = _drawn(lay_canvas(foundation, np.zeros((0, 2), np.int64)), colors)
        scene = Scene(balls().pixels, foundation, colors)
        points, all_colors = worst_pixels(scene, TERMS, lambda _: None, StageClock())
        refined = _drawn(lay_canvas(foundation, points), all_colors)
        result[f"mse {name}"] = float(((bare - picture) ** 2).mean() * 65025)
        result[f"points {name}"] = len(points)
        row.append([to_8_bit(bare), to_8_bit(refined)])
    figures.save("offset_sampling", row)
    return result


def _drawn(canvas: Canvas, colors: NDArray[np.float64]) -> NDArray[np.float64]:
    network, drawing = canvas.foundation.network, canvas.drawing()
    operator, corner_color = canvas.operator(drawing)
    return raster.paint(
        drawing.image, drawing.triangles, operator @ colors, corner_color, network.width, network.height
    )


if __name__ == "__main__":
    print(main())
