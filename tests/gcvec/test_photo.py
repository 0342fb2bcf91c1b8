"""What is no photo is refused in one line, before any kernel sees it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from gcvec import InputError, vectorize
from gcvec.metrics import compare
from gcvec.photo import require_photo
from tests.gcvec.scenes import SCENES

NO_PHOTOS = {
    "with an alpha channel": np.zeros((8, 9, 4), np.uint8),
    "gray": np.zeros((8, 9), np.uint8),
    "of floats": np.zeros((8, 9, 3)),
    "of 16 bits": np.zeros((8, 9, 3), np.uint16),
    "empty": np.zeros((0, 9, 3), np.uint8),
    "a list": [[[0, 0, 0]]],
}


@pytest.mark.parametrize("pixels", NO_PHOTOS.values(), ids=NO_PHOTOS.keys())
def test_what_is_no_photo_is_refused(pixels: Any) -> None:
    with pytest.raises(InputError, match=r"\(h, w, 3\) of uint8") as told:
        vectorize(pixels)
    assert told.value.code == "bad-picture"


def test_a_picture_of_more_pixels_than_a_file_can_hold_is_refused() -> None:
    pixel = np.zeros((1, 1, 3), np.uint8)
    require_photo(np.broadcast_to(pixel, (8192, 8192, 3)))
    with pytest.raises(InputError, match="8193 x 8192 pixels, a vector image holds 67108864") as told:
        vectorize(np.broadcast_to(pixel, (8192, 8193, 3)))
    assert told.value.code == "bad-picture"


def test_a_comparison_wants_a_photo_too() -> None:
    image = vectorize(SCENES["whole"].picture())
    with pytest.raises(InputError, match=r"\(h, w, 3\) of uint8"):
        compare(np.zeros((image.height, image.width, 4), np.uint8), image, 0)


@pytest.mark.parametrize("scale", [0.0, -1.0, float("nan"), float("inf"), 1e6])
def test_a_scale_that_cannot_be_drawn_is_refused(scale: float) -> None:
    image = vectorize(SCENES["whole"].picture())
    with pytest.raises(InputError, match="scale") as told:
        image.render(scale)
    assert told.value.code == "bad-option"
