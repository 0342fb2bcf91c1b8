"""Structural similarity against scikit-image's."""

from __future__ import annotations

import numpy as np
import pytest
from skimage.metrics import structural_similarity

from gcvec import ssim as module
from gcvec.ssim import STABILIZERS, ssim

C1, C2 = STABILIZERS


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


def plain(a: np.ndarray, b: np.ndarray, down: int, across: int) -> float:
    """The mean over windows of so many pixels, one after another."""
    found = []
    for i in range(a.shape[0] - down + 1):
        for j in range(a.shape[1] - across + 1):
            for k in range(3):
                x, y = (z[i : i + down, j : j + across, k].astype(float).ravel() for z in (a, b))
                ((vx, vxy), (_, vy)) = np.cov(x, y) if len(x) > 1 else np.zeros((2, 2))
                light = (2 * x.mean() * y.mean() + C1) / (x.mean() ** 2 + y.mean() ** 2 + C1)
                found.append(light * (2 * vxy + C2) / (vx + vy + C2))
    return float(np.mean(found))


@pytest.mark.parametrize(
    ("height", "width", "down", "across"),
    [(2, 9, 2, 7), (9, 2, 7, 2), (300, 1, 7, 1), (1, 6, 1, 5), (2, 2, 2, 2), (1, 2, 1, 2), (1, 1, 1, 1)],
)
def test_a_window_lies_within_a_picture_of_few_pixels(
    height: int, width: int, down: int, across: int
) -> None:
    a, b = pair(height, width)
    assert ssim(a, a) == pytest.approx(1, rel=1e-12)
    assert ssim(a, b) == pytest.approx(plain(a, b, down, across), rel=1e-9)
    assert ssim(a, b) < 1
