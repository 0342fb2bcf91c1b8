"""Raster codecs at the same error."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.pictures import picture

CODECS: dict[str, dict[str, Any]] = {
    "JPEG 4:4:4": {"format": "JPEG", "subsampling": 0, "optimize": True, "progressive": True},
    "WebP": {"format": "WEBP", "method": 6},
    "AVIF": {"format": "AVIF", "subsampling": "4:4:4", "speed": 6},
}

BEST = 100


def sizes(name: str, megapixels: float, codec: str, targets: Sequence[float]) -> list[dict[str, Any]]:
    """For each target the bytes and error of the smallest file within it; of the best one if none is."""
    photo = picture(name, megapixels)
    made: dict[int, dict[str, Any]] = {}

    def at(quality: int) -> dict[str, Any]:
        if quality not in made:
            buffer = BytesIO()
            Image.fromarray(photo).save(buffer, quality=quality, **CODECS[codec])
            with Image.open(buffer) as read:
                error = np.asarray(read.convert("RGB")).astype(float) - photo
            made[quality] = {"bytes": len(buffer.getvalue()), "mse": float((error**2).mean())}
        return made[quality]

    def smallest(target: float) -> dict[str, Any]:
        low, high = 0, BEST  # below the first, within the target at the second, if at all
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if at(middle)["mse"] <= target else (middle, high)
        return at(high)

    return [smallest(target) for target in targets]
