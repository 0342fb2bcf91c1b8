"""What counts as a photo."""

from __future__ import annotations

from typing import Any

import numpy as np

from gcvec.errors import InputError

MOST_PIXELS = 1 << 26
"""No file holds a larger picture: that is part of the format (`gcvec.codec.limits`)."""


def require_photo(pixels: Any) -> None:
    """Raise `InputError` ("bad-picture") for anything but an array `(h, w, 3) uint8` with pixels in it, no
    more of them than a file can hold.

    Kernels trust in the shape, so this comes first wherever pixels come in.
    """
    if not isinstance(pixels, np.ndarray):
        raise InputError(
            f"pixels must be an array (h, w, 3) of uint8, not {type(pixels).__name__}", code="bad-picture"
        )
    if pixels.ndim != 3 or pixels.shape[2] != 3 or pixels.dtype != np.uint8 or not pixels.size:
        told = f"{pixels.shape} of {pixels.dtype}"
        raise InputError(f"pixels must be an array (h, w, 3) of uint8, not {told}", code="bad-picture")
    height, width = pixels.shape[:2]
    if height * width > MOST_PIXELS:
        raise InputError(
            f"the picture has {width} x {height} pixels, a vector image holds {MOST_PIXELS} at most",
            code="bad-picture",
        )
