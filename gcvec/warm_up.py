"""Runs the whole engine once, so that everything it needs is loaded or compiled."""

from __future__ import annotations

import logging
import time
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from gcvec.vector_image import VectorImage

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
    from gcvec import Annotations, Options, Shape, vectorize
    from gcvec.export import error_map
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
    store_and_draw(made)
    write_cvat_xml(segment(pixels), "picture.png")
    error_map(pixels, made)
    logger.info("engine ready after %.1f s", time.perf_counter() - started)


def store_and_draw(image: VectorImage) -> None:
    """Write and read a vector image, draw it, and write every file that can be made of it."""
    from gcvec import VectorImage
    from gcvec.export import patch_overlay
    from gcvec.export.glb import glb
    from gcvec.export.pdf import pdf
    from gcvec.export.svg import svg

    image = VectorImage.from_bytes(image.to_bytes())
    image.render(scale=2)
    patch_overlay(image)
    for export in (svg, pdf, glb):
        export(image)


def made_image() -> VectorImage:
    """A disc in a square, made without the engine."""
    from gcvec import VectorImage
    from gcvec.curves.loops import network_loops
    from gcvec.curves.network import Curve, Network, straight_line
    from gcvec.patches.canonical import lay_foundation

    side = 64
    corners = side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    turn = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    circle = side * (0.5 + 0.25 * np.stack([np.cos(turn), np.sin(turn)], axis=1))
    ends = [(i, (i + 1) % 4) for i in range(4)]
    frame = [Curve(straight_line(corners[a], corners[b], 2), -1, 0, a, b) for a, b in ends]
    curves = (*frame, Curve(circle, 0, 1, -1, -1))
    network = Network(side, side, 4, curves, network_loops(curves, 2))
    hard = np.zeros(len(curves), bool)
    colors = np.random.default_rng(0)
    boundary_colors = colors.random((lay_foundation(network, hard).space.size, 3))
    ys, xs = np.mgrid[4:side:4, 4:side:4]
    points = np.stack([xs.ravel(), ys.ravel()], axis=1)
    return VectorImage(
        network, hard, boundary_colors, points, colors.random((len(points), 3)), labels=("square", "disc")
    )


def _picture(side: int) -> NDArray[np.uint8]:
    """A shaded disc before a gradient, beside noise where there is room for it."""
    y, x = np.mgrid[:side, :side].astype(float)
    gray = np.where(np.hypot(x - 30, y - 40) < 16, 200 - 0.1 * (x - 30) ** 2, 60 + x / 2)
    noise = np.random.default_rng(0).normal(0, 12, gray.shape)
    pixels = np.stack([gray, gray + 0.2 * y, 120 - gray / 4], axis=-1)
    return np.asarray(pixels + np.where(x > 192, noise, 0)[..., None]).clip(0, 255).astype(np.uint8)
