"""A small photo of a shaded box on a shaded ground, and its regions."""

from __future__ import annotations

import numpy as np

WIDTH, HEIGHT = 64, 48


def photo_pixels() -> np.ndarray:
    """A shaded box on a shaded ground, `(48, 64, 3) uint8`."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    ground = np.stack([60 + x, 90 + y, 200 - x - y], axis=-1)
    box = np.stack([250 - x, 120 + x, 40 + 2 * y], axis=-1)
    inside = (x >= 17) & (x < 43) & (y >= 14) & (y < 34)
    return np.asarray(np.where(inside[..., None], box, ground), np.uint8)


def polygon(points: str, label: str = "it", z_order: int = 0) -> str:
    return f'<polygon label="{label}" points="{points}" z_order="{z_order}"></polygon>'


GROUND = polygon(f"0,0;{WIDTH},0;{WIDTH},{HEIGHT};0,{HEIGHT}", "ground")
BOX = polygon("16,12;45,15;41,36;18,33", "box", 1)


def cvat(*polygons: str, name: str = "photo.png", width: int = WIDTH, height: int = HEIGHT) -> str:
    shapes = "\n".join(polygons)
    image = f'<image id="0" name="{name}" width="{width}" height="{height}">\n{shapes}\n</image>'
    return f'<?xml version="1.0"?>\n<annotations><version>1.1</version>\n{image}\n</annotations>'
