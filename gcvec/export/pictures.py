"""Pictures about a vector image: where it errs, and what it is made of."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from gcvec.curves import bspline
from gcvec.vector_image import VectorImage

ERROR_GAIN = 8
OUTLINE, DOMAIN, VERTEX, POINT = (255, 64, 32), (64, 200, 255), (255, 255, 255), (255, 224, 64)


def error_map(pixels: NDArray[np.uint8], image: VectorImage) -> NDArray[np.uint8]:
    """Absolute error of every pixel and channel `(h, w, 3) uint8`, amplified eight times on black."""
    error = np.abs(image.picture.astype(np.int64) - pixels)
    return np.asarray(np.minimum(ERROR_GAIN * error, 255), np.uint8)


def patch_overlay(image: VectorImage, scale: float = 1.0) -> NDArray[np.uint8]:
    """The dimmed picture `(H, W, 3) uint8` under outlines, parameter polygons and control points."""
    picture = Image.fromarray((image.render(scale) * 0.55).astype(np.uint8))
    pen = ImageDraw.Draw(picture)
    samples = image.foundation.samples
    for ends in samples.domain[samples.edge_ends] * scale:
        pen.line([tuple(p) for p in ends], fill=DOMAIN)
    offsets = image.network.offsets
    for curve, (first, past) in zip(image.network.curves, pairwise(offsets), strict=True):
        u = np.linspace(0, curve.segments, 8 * curve.segments + 1)
        control_points = image.foundation.control_points[first:past]  # where an edit has moved them
        points = bspline.evaluate(control_points, u, curve.closed) * scale
        pen.line([tuple(p) for p in points], fill=OUTLINE)
    radius = max(0.5, 0.3 * scale)
    places = image.canvas.places[: len(image.points)]
    for marks, color in ((places, POINT), (samples.domain[np.unique(samples.edge_ends)], VERTEX)):
        for x, y in marks * scale:
            pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=color)
    return np.asarray(picture)
