"""The pictures of README.md: `python -m examples.readme_pictures` writes them to docs/figures/."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from examples.demo import ANNOTATIONS
from gcvec import Options, vectorize
from gcvec.export import patch_overlay
from gcvec.io import read_annotations, read_picture

FOLDER = Path(__file__).parents[1] / "docs" / "figures"
DETAIL = (slice(78, 158), slice(128, 248))
"""Rows and columns of the photo that the enlargement shows: an eye."""

SCALE = 5


def main() -> None:
    photo = read_picture((files("skimage") / "data" / "chelsea.png").read_bytes()).pixels
    regions = read_annotations(ANNOTATIONS.read_bytes(), picture_name="chelsea.png")
    image = vectorize(photo, regions, Options(max_points=0))
    FOLDER.mkdir(parents=True, exist_ok=True)
    save("overview.jpg", side_by_side(photo, image.render()))
    detail = tuple(slice(SCALE * part.start, SCALE * part.stop) for part in DETAIL)
    enlarged = np.kron(photo[DETAIL], np.ones((SCALE, SCALE, 1), np.uint8))
    save(
        "detail.jpg", side_by_side(enlarged, patch_overlay(image, SCALE)[detail], image.render(SCALE)[detail])
    )


def side_by_side(*pictures: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Pictures `(h, w, 3)` of one size from left to right, ten white pixels apart."""
    gap = np.full((len(pictures[0]), 10, 3), 255, np.uint8)
    row = [part for picture in pictures for part in (gap, picture)][1:]
    return np.concatenate(row, axis=1)


def save(name: str, picture: NDArray[np.uint8]) -> None:
    Image.fromarray(picture).save(FOLDER / name, quality=80, optimize=True)


if __name__ == "__main__":
    main()
