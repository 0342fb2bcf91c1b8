"""How close a vector image comes to its photo, and what it cost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gcvec.error_scale import PEAK_SQUARE
from gcvec.errors import InputError
from gcvec.photo import require_photo
from gcvec.ssim import ssim

if TYPE_CHECKING:
    from gcvec.vector_image import VectorImage


@dataclass(frozen=True)
class RegionReport:
    """One patch: its control points, the iterations that gave it some, and its mean squared error."""

    id: int
    label: str
    points: int
    iterations: int
    mse: float


@dataclass(frozen=True)
class Report:
    """Errors are on the 0-255 scale, over R, G and B, of the box-filtered picture (`mse_raw`: of pixel
    centres)."""

    width: int
    height: int
    patches: int
    points: int
    mse: float
    mse_raw: float
    mae: float
    psnr: float
    ssim: float
    bytes: int
    foldovers: int
    strategy: str = ""
    seconds: Mapping[str, float] = field(default_factory=dict)
    regions: tuple[RegionReport, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """The report as JSON-ready data."""
        result = asdict(self)
        size = {"width": result.pop("width"), "height": result.pop("height")}
        return {"image": size, **result, "seconds": dict(self.seconds)}


def compare(pixels: NDArray[np.uint8], image: VectorImage, n_bytes: int) -> Report:
    """Measure `image` against its photo `(h, w, 3) uint8`; `InputError` when the sizes differ."""
    require_photo(pixels)
    height, width = pixels.shape[:2]
    if (width, height) != (image.width, image.height):
        raise InputError(
            f"the picture is {width} x {height} pixels, the vector image {image.width} x {image.height}",
            code="size-mismatch",
        )
    square = squared_error(image.picture, pixels)
    mse = float(square.mean())
    return Report(
        width=width,
        height=height,
        patches=len(image.labels),
        points=len(image.points),
        mse=mse,
        mse_raw=float(squared_error(image.render(raw=True), pixels).mean()),
        mae=float(np.sqrt(square).mean()),
        psnr=psnr(mse),
        ssim=ssim(pixels, image.picture),
        bytes=n_bytes,
        foldovers=image.foldovers,
        regions=_regions(image, square.mean(axis=2)),
    )


def squared_error(a: NDArray[np.uint8], b: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Of two pictures `(h, w, 3)`, for every pixel and channel `(h, w, 3)`, on the 0-255 scale."""
    return np.asarray(np.square(np.subtract(a, b, dtype=np.int16), dtype=np.int32))


def _regions(image: VectorImage, square: NDArray[np.float64]) -> tuple[RegionReport, ...]:
    n = len(image.labels)
    owner = image.foundation.geometry.patch_at().ravel()
    area = np.maximum(np.bincount(owner, minlength=n), 1)
    mse = np.bincount(owner, square.ravel(), n) / area
    points = np.bincount(image.patch_of_points, minlength=n)
    return tuple(RegionReport(k, image.labels[k], int(points[k]), 0, float(mse[k])) for k in range(n))


def psnr(mse: float) -> float:
    """Peak signal-to-noise ratio in dB; 100 for equal pictures, so that it stays a number in JSON."""
    return float(min(10 * np.log10(PEAK_SQUARE / mse), 100.0)) if mse > 0 else 100.0
