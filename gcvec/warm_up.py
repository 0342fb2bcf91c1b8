"""Runs the whole engine once, so that everything it needs is loaded or compiled."""

from __future__ import annotations

import logging
import time

import numpy as np
from numpy.typing import NDArray

logger = logging.getLogger(__name__)

SIDE = 256
"""Of a picture, in pixels, that calls every kernel."""

_LOADING_SIDE = 64
"""Of one that loads every module: that is enough where the kernels are in a library."""


def warm_up(side: int | None = None) -> None:
    """Vectorize a small picture that has a bit of everything, with drawn regions and without; write its
    regions, and every file that can be made of it.

    Without a `side`, in pixels, the picture is as small as it may be.
    """
    from gcvec import Annotations, Options, Shape, VectorImage, vectorize
    from gcvec.export import error_map, patch_overlay
    from gcvec.export.glb import glb
    from gcvec.export.pdf import pdf
    from gcvec.export.svg import svg
    from gcvec.io import write_cvat_xml
    from gcvec.kernels import library
    from gcvec.regions.segment import segment

    started = time.perf_counter()
    pixels = _picture(side or (_LOADING_SIDE if library() else SIDE))
    # They leave gaps, thin ones and wide ones, one lies on another, and one is too small to stay.
    left = np.array([[0.0, 0.0], [191.0, 0.0], [190.0, 256.0], [0.0, 256.0]])
    right = np.array([[193.0, 0.0], [256.0, 0.0], [256.0, 200.0], [192.0, 200.0]])
    speck = np.array([[120.0, 120.0], [123.0, 120.0], [123.0, 123.0]])
    turn = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    disc = np.stack([30 + 17 * np.cos(turn), 40 + 17 * np.sin(turn)], axis=1)
    drawn = Annotations(
        tuple(Shape(str(i), rings=(ring,)) for i, ring in enumerate((left, right, disc, speck)))
    )
    for regions, workers in ((drawn, 1), (None, 0)):
        made = vectorize(pixels, regions, Options(max_points=0, target_mse=20, workers=workers))
    result = VectorImage.from_bytes(made.to_bytes())
    result.render(scale=2)
    write_cvat_xml(segment(pixels), "picture.png")
    error_map(pixels, result)
    patch_overlay(result)
    for export in (svg, pdf, glb):
        export(result)
    logger.info("engine ready after %.1f s", time.perf_counter() - started)


def _picture(side: int) -> NDArray[np.uint8]:
    """A shaded disc before a gradient, beside noise where there is room for it."""
    y, x = np.mgrid[:side, :side].astype(float)
    gray = np.where(np.hypot(x - 30, y - 40) < 16, 200 - 0.1 * (x - 30) ** 2, 60 + x / 2)
    noise = np.random.default_rng(0).normal(0, 12, gray.shape)
    pixels = np.stack([gray, gray + 0.2 * y, 120 - gray / 4], axis=-1)
    return np.asarray(pixels + np.where(x > 192, noise, 0)[..., None]).clip(0, 255).astype(np.uint8)
