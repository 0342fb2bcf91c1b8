"""Structural similarity against scikit-image's."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from gcvec import ssim as module
from gcvec.ssim import ssim


def pair(height: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    a = rng.integers(0, 256, (height, width, 3))
    return a.astype(np.uint8), np.clip(a + rng.normal(0, 30, a.shape), 0, 255).astype(np.uint8)


@pytest.mark.parametrize(("height", "width", "window"), [(40, 61, 7), (6, 30, 5), (9, 4, 3), (700, 8, 7)])
def test_it_is_scikit_images(height: int, width: int, window: int) -> None:
    a, b = pair(height, width)
    wanted = structural_similarity(a, b, win_size=window, channel_axis=2, data_range=255)
    assert ssim(a, b) == pytest.approx(wanted, rel=1e-12)


def test_bands_do_not_show(monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = pair(50, 20)
    whole = ssim(a, b)
    monkeypatch.setattr(module, "BAND", 9)
    assert ssim(a, b) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (2, 9)])
def test_pictures_smaller_than_a_window_are_the_same_or_not(height: int, width: int) -> None:
    a, b = pair(height, width)
    assert (ssim(a, a), ssim(a, b)) == (1, 0)
