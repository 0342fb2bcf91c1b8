"""Draw a picture from its result JSON alone: python draw_from_json.py RESULT.json PICTURE.png [SCALE]"""

import json
import sys

import numpy as np
from PIL import Image

SUPERSAMPLING = 4


def draw(result: dict, scale: float = 1.0) -> np.ndarray:
    """The picture `(height * scale, width * scale, 3) uint8` of a "gcvec/1" result."""
    width, height = (round(result["image"][side] * scale) for side in ("width", "height"))
    mesh = result["mesh"]
    positions = np.array(mesh["positions"]) * scale * SUPERSAMPLING
    colors = np.array(mesh["colors"])
    fine = np.zeros((height * SUPERSAMPLING, width * SUPERSAMPLING, 3))
    for triangle in mesh["triangles"]:
        fill(fine, positions[triangle], colors[triangle])
    blocks = fine.reshape(height, SUPERSAMPLING, width, SUPERSAMPLING, 3)
    return np.rint(blocks.mean(axis=(1, 3)) * 255).astype(np.uint8)


def fill(picture: np.ndarray, corners: np.ndarray, colors: np.ndarray) -> None:
    """Blend the corners' colours linearly over the pixels whose centres lie in the triangle."""
    limits = np.array(picture.shape[1::-1])
    first = np.clip(np.ceil(corners.min(axis=0) - 0.5), 0, limits).astype(int)
    end = np.clip(np.floor(corners.max(axis=0) - 0.5) + 1, 0, limits).astype(int)
    x, y = np.meshgrid(np.arange(first[0], end[0]) + 0.5, np.arange(first[1], end[1]) + 0.5)
    a, b, c = corners
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    if area == 0 or x.size == 0:
        return
    of_b = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
    of_c = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
    share = np.stack([1 - of_b - of_c, of_b, of_c], axis=-1)
    inside = share.min(axis=-1) >= -1e-9
    picture[first[1] : end[1], first[0] : end[0]][inside] = share[inside] @ colors


if __name__ == "__main__":
    source, target, *rest = sys.argv[1:]
    with open(source) as file:
        Image.fromarray(draw(json.load(file), *map(float, rest))).save(target)
