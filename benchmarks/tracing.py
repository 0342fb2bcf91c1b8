"""vtracer: regions of one colour each, outlined by splines."""

from __future__ import annotations

import gzip
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.pictures import picture

SETTINGS = [
    {"mode": mode, "layer_difference": step, "filter_speckle": speckle}
    for mode in ("spline", "polygon", "none")
    for step in (0, 4, 16)
    for speckle in (0, 4)
]
"""Form of outlines ("none" follows pixel edges), levels between colour layers, and the side in pixels below
which patches are left out."""


def sizes(name: str, megapixels: float, targets: Sequence[float]) -> list[dict[str, Any]]:
    """For each target the bytes (gzip) and error of the smallest drawing within it, or else the closest."""
    photo = picture(name, megapixels)
    drawings = [_traced(photo, settings) for settings in SETTINGS]
    closest = min(drawings, key=lambda drawing: drawing["mse"])
    found = []
    for target in targets:
        within = [drawing for drawing in drawings if drawing["mse"] <= target]
        found.append(min(within, key=lambda drawing: drawing["bytes"]) if within else closest)
    return found


def _traced(photo: np.ndarray, settings: Mapping[str, Any]) -> dict[str, Any]:
    import resvg_py
    import vtracer

    buffer = BytesIO()
    Image.fromarray(photo).save(buffer, "PNG")
    svg = vtracer.convert_raw_image_to_svg(buffer.getvalue(), "png", color_precision=8, **settings)
    height, width = photo.shape[:2]
    drawn = resvg_py.svg_to_bytes(svg_string=svg, width=width, height=height, background="#ffffff")
    with Image.open(BytesIO(bytes(drawn))) as picture_of_it:
        error = np.asarray(picture_of_it.convert("RGB")).astype(float) - photo
    return {"bytes": len(gzip.compress(svg.encode(), 9)), "mse": float((error**2).mean())}
