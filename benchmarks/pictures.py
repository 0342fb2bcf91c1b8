"""Photos that come inside scikit-image's wheel, at any size."""

from __future__ import annotations

from importlib.resources import files
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

FILES = {
    "astronaut": "astronaut.png",
    "chelsea": "chelsea.png",
    "coffee": "coffee.png",
    "rocket": "rocket.jpg",
}


def picture(name: str, megapixels: float) -> NDArray[np.uint8]:
    """The photo `(h, w, 3)` resampled to about so many megapixels, in its own proportions."""
    data = (files("skimage") / "data" / FILES[name]).read_bytes()
    with Image.open(BytesIO(data)) as photo:
        zoom = (megapixels * 1e6 / (photo.width * photo.height)) ** 0.5
        size = (round(photo.width * zoom), round(photo.height * zoom))
        return np.asarray(photo.convert("RGB").resize(size, Image.Resampling.LANCZOS))
