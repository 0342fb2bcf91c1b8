"""The stages from photo to vector image (paper, Figs. 3 and 4).

Photo, regions, parameter polygons, curves with their colours; the patches without interior control points,
those points, the picture, and the picture at four times the size.
"""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageDraw

from examples import figures
from examples.scenes import balls, vectorized_balls
from gcvec import VectorImage
from gcvec.curves import bspline
from gcvec.patches.color_space import LEFT, RIGHT
from gcvec.vector_image import to_8_bit

WHITE, INK, RED = (255, 255, 255), (20, 40, 90), (226, 74, 51)


def main() -> dict[str, int]:
    """What every stage made."""
    scene, image = balls(), vectorized_balls()
    samples = image.foundation.samples
    bare = VectorImage(
        image.network,
        image.hard,
        image.boundary_colors,
        image.points[:0],
        image.point_colors[:0],
        image.labels,
    )
    cut = (slice(80, 80 + 180), slice(520, 520 + 240))
    figures.save(
        "stages",
        [
            [scene.pixels, regions(image), polygons(image), curves(image)],
            [bare.render(), points(image), image.render(), image.render(4)[cut]],
        ],
        step=4,
    )
    return {
        "patches": len(image.labels),
        "curves": len(image.curves),
        "polygon edges": len(samples.edge_curve),
        "hard curves": int(image.hard.sum()),
        "points": len(image.points),
        "foldovers": image.foldovers,
    }


def regions(image: VectorImage) -> figures.Panel:
    """Every patch in its mean colour."""
    owner, picture = image.foundation.geometry.patch_at(), image.render().astype(np.float64)
    area = np.maximum(np.bincount(owner.ravel()), 1)
    mean = [np.bincount(owner.ravel(), picture[..., c].ravel()) / area for c in range(3)]
    return to_8_bit(np.stack(mean, axis=1)[owner] / 255)


def polygons(image: VectorImage) -> figures.Panel:
    """Parameter polygons and their vertices."""
    samples = image.foundation.samples
    canvas, pen, scale = _blank(image)
    for ends in samples.domain[samples.edge_ends] * scale:
        pen.line([tuple(p) for p in ends], fill=INK, width=2)
    _dots(pen, samples.domain[np.unique(samples.edge_ends)] * scale, RED, 1.3 * scale)
    return _averaged(canvas, scale)


def curves(image: VectorImage) -> figures.Panel:
    """Curves in the colours of their two sides."""
    offsets, unknown = image.foundation.samples.offsets, image.foundation.space.of_control
    canvas, pen, scale = _blank(image)
    for c, curve in enumerate(image.curves):
        own = slice(offsets[c], offsets[c + 1])
        u = np.linspace(0, curve.segments, 12 * curve.segments + 1)
        at = bspline.evaluate(image.foundation.control_points[own], u, curve.closed)
        along = np.gradient(at, axis=0)
        normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
        for side, outward in ((RIGHT, 1.0), (LEFT, -1.0)):
            if unknown[side, own][0] < 0:
                continue
            color = to_8_bit(bspline.evaluate(image.boundary_colors[unknown[side, own]], u, curve.closed))
            where = (at + 1.2 * outward * normal) * scale
            for a, b, shade in zip(where[:-1], where[1:], color, strict=False):
                pen.line([tuple(a), tuple(b)], fill=tuple(int(s) for s in shade), width=2 * scale)
    return _averaged(canvas, scale)


def points(image: VectorImage) -> figures.Panel:
    """Interior control points in their colours."""
    canvas, pen, scale = _blank(image)
    samples = image.foundation.samples
    for ends in samples.domain[samples.edge_ends] * scale:
        pen.line([tuple(p) for p in ends], fill=INK, width=1)
    for place, color in zip(
        image.canvas.places[: len(image.points)], to_8_bit(image.point_colors), strict=True
    ):
        _dots(pen, place[None] * scale, tuple(int(s) for s in color), 1.1 * scale)
    return _averaged(canvas, scale)


def _blank(image: VectorImage) -> tuple[Image.Image, ImageDraw.ImageDraw, int]:
    scale = figures.SMOOTHING
    canvas = Image.new("RGB", (image.width * scale, image.height * scale), WHITE)
    return canvas, ImageDraw.Draw(canvas), scale


def _dots(pen: ImageDraw.ImageDraw, at: np.ndarray, color: tuple[int, ...], radius: float) -> None:
    for x, y in at:
        pen.ellipse((x - radius, y - radius, x + radius, y + radius), fill=color)


def _averaged(canvas: Image.Image, scale: int) -> figures.Panel:
    size = (canvas.width // scale, canvas.height // scale)
    return np.asarray(canvas.resize(size, Image.Resampling.BOX))


if __name__ == "__main__":
    print(main())
