"""Two small vector images that exports and the client are tried on."""

import numpy as np
from skimage import data

from gcvec import Annotations, Options, Shape, VectorImage, vectorize

WIDTH, HEIGHT = 120, 80


def ellipse(x: float, y: float, rx: float, ry: float) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    return np.stack([x + rx * np.cos(angle), y + ry * np.sin(angle)], axis=1)


def photo() -> VectorImage:
    """A face in a real photo, with an island in it and a region at the frame."""
    pixels = np.ascontiguousarray(data.astronaut()[20 : 20 + HEIGHT, 160 : 160 + WIDTH])
    corner = np.array([[0, 50], [40, 60], [30, HEIGHT], [0, HEIGHT]], float)
    shapes = (
        Shape("face", (ellipse(60, 45, 32, 30),)),
        Shape('<eye> & "brow"', (ellipse(60, 40, 9, 7),), z_order=1),
        Shape("corner", (corner,), z_order=1),
    )
    return vectorize(pixels, Annotations(shapes), Options(target_mse=60))


def drawing() -> VectorImage:
    """A bright disc with a hole over a dark ground: hard edges, and shading that is smooth and strong."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    distance = np.hypot(x - 60, y - 40)
    disc = np.stack([250 - x / 2, 130 + y, 60 + x], axis=-1)
    ground = np.stack([20 + x / 3, 30 + y / 2, 90 - x / 3], axis=-1)
    cover = np.clip(30.5 - distance, 0, 1) * np.clip(distance - 11.5, 0, 1)
    pixels = np.rint(cover[..., None] * disc + (1 - cover[..., None]) * ground).astype(np.uint8)
    shapes = (Shape("disc", (ellipse(60, 40, 30, 30),)), Shape("hole", (ellipse(60, 40, 12, 12),), z_order=1))
    return vectorize(pixels, Annotations(shapes), Options(target_mse=3))
