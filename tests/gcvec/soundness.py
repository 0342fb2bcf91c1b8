"""What holds of every picture that is made."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec import VectorImage
from gcvec.metrics import compare


def assert_sound(image: VectorImage, pixels: np.ndarray) -> None:
    """No fold-over, and figures that are those of the picture it draws."""
    assert image.foldovers == 0
    report = image.report
    assert report is not None
    rendered = image.render()
    assert rendered.shape == pixels.shape
    assert report.mse == pytest.approx(((rendered.astype(float) - pixels) ** 2).mean(), abs=0.05)
    assert report.mae == pytest.approx(np.abs(rendered.astype(float) - pixels).mean(), abs=0.05)
    assert report.bytes == len(image.to_bytes())
    assert report.points == len(image.points) == sum(region.points for region in report.regions)
    assert report.patches == len(image.labels) == len(report.regions)
    assert report.foldovers == 0
    assert all((region.iterations > 0) >= (region.points > 0) for region in report.regions)
    again = compare(pixels, VectorImage.from_bytes(image.to_bytes()), report.bytes)
    assert (again.mse, again.ssim) == pytest.approx((report.mse, report.ssim))
