"""Made scenes with known truth: every border and every colour in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from gcvec import Annotations, Options, Shape, VectorImage, vectorize

Floats = NDArray[np.float64]

SUPERSAMPLING = 4
"""Samples along each side of a pixel of the enlarged picture."""

ENLARGEMENT = 4
HAND = 0.8
"""A drawn polygon stays within this distance of its circle, pixels."""

VERTEX_SPACING = 7.0


@dataclass(frozen=True)
class Ball:
    """A disc, pixels, shaded like a matte ball lit from the top left; `color` is sRGB in [0, 1]."""

    x: float
    y: float
    radius: float
    color: tuple[float, float, float]


@dataclass(frozen=True)
class Scene:
    """A picture whose truth is known.

    pixels       (h, w, 3) uint8, the box-filtered photo
    enlarged     (4 h, 4 w, 3) uint8, the same scene box-filtered at four times the size
    annotations  a polygon around every ball, as a hand would draw it
    balls        back to front: a later one hides what it overlaps
    """

    pixels: NDArray[np.uint8]
    enlarged: NDArray[np.uint8]
    annotations: Annotations
    balls: tuple[Ball, ...]

    def distance_to_circles(self, points: Floats) -> Floats:
        """Distance of `points` `(n, 2)`, pixels, from the nearest of the circles."""
        circles = np.array([(b.x, b.y, b.radius) for b in self.balls])
        distance = np.hypot(points[:, None, 0] - circles[:, 0], points[:, None, 1] - circles[:, 1])
        return np.asarray(np.abs(distance - circles[:, 2]).min(axis=1))


BALLS = (
    Ball(52.3, 57.8, 33.4, (0.70, 0.20, 0.16)),
    Ball(123.6, 48.2, 24.7, (0.20, 0.45, 0.70)),
    Ball(193.4, 58.9, 34.2, (0.70, 0.55, 0.18)),
    Ball(70.7, 128.1, 27.9, (0.25, 0.60, 0.30)),
    Ball(146.2, 120.6, 38.8, (0.66, 0.64, 0.69)),
    Ball(177.9, 143.3, 17.3, (0.55, 0.25, 0.60)),
)


def balls(seed: int = 0) -> Scene:
    """Six shaded balls before a gradient, 240 x 180; the last one partly hides another.

    `seed` draws the hand's errors; the picture is always the same.
    """
    width, height = 240, 180
    enlarged = _box_filtered(BALLS, width, height, ENLARGEMENT)
    pixels = enlarged.reshape(height, ENLARGEMENT, width, ENLARGEMENT, 3).mean(axis=(1, 3))
    rng = np.random.default_rng(seed)
    shapes = tuple(
        Shape(f"ball {k}", rings=(_drawn_circle(ball, rng),), z_order=k) for k, ball in enumerate(BALLS)
    )
    return Scene(
        np.rint(pixels * 255).astype(np.uint8),
        np.rint(enlarged * 255).astype(np.uint8),
        Annotations(shapes, width, height),
        BALLS,
    )


def color(scene: tuple[Ball, ...], x: Floats, y: Floats, width: int, height: int) -> Floats:
    """sRGB in [0, 1] of the scene at points `x`, `y` (any shape, pixels), without filtering."""
    u, v = x / width, y / height
    result = np.stack(
        [0.35 + 0.30 * u + 0.10 * v, 0.50 + 0.10 * u - 0.20 * v, 0.60 - 0.25 * u * v + 0.05 * v], -1
    )
    for ball in scene:
        dx, dy = (x - ball.x) / ball.radius, (y - ball.y) / ball.radius
        square = dx * dx + dy * dy
        shade = 1.0 - 0.30 * square - 0.22 * dx - 0.28 * dy
        gloss = 0.2 * np.exp(-((dx + 0.35) ** 2 + (dy + 0.40) ** 2) / 0.08)
        inside = square < 1
        result[inside] = shade[inside, None] * np.array(ball.color) + gloss[inside, None]
    return result


def _box_filtered(scene: tuple[Ball, ...], width: int, height: int, scale: int) -> Floats:
    """The scene `(scale * height, scale * width, 3)` averaged over its pixels."""
    samples = scale * SUPERSAMPLING
    x = (np.arange(width * samples) + 0.5) / samples
    rows = []
    for row in range(height * scale):
        y = (row * SUPERSAMPLING + np.arange(SUPERSAMPLING) + 0.5) / samples
        fine = color(scene, *np.meshgrid(x, y), width, height)
        rows.append(fine.reshape(SUPERSAMPLING, width * scale, SUPERSAMPLING, 3).mean(axis=(0, 2)))
    return np.stack(rows)


def _drawn_circle(ball: Ball, rng: np.random.Generator) -> Floats:
    """A polygon `(n, 2)` whose vertices and edges stay within `HAND` of the circle."""
    n = int(np.ceil(2 * np.pi * ball.radius / VERTEX_SPACING))
    angle = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    sagitta = ball.radius * (1 - np.cos(1.6 * np.pi / n))
    radius = ball.radius + rng.uniform(sagitta - HAND, HAND, n)
    return np.stack([ball.x + radius * np.cos(angle), ball.y + radius * np.sin(angle)], axis=1)


@cache
def vectorized_balls(target_mse: float = 2.0) -> VectorImage:
    """The vector image of the scene, made once."""
    scene = balls()
    return vectorize(scene.pixels, scene.annotations, Options(target_mse=target_mse))
