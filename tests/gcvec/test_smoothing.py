"""Filters against scipy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from gcvec.smoothing import box_mean, gaussian

SIZES = [(40, 61), (5, 3), (1, 30), (30, 1), (1, 1)]


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("order", [(0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (2, 0)])
@pytest.mark.parametrize("sigma", [1.0, 2.5])
def test_gaussians_are_scipys(size: tuple[int, int], order: tuple[int, int], sigma: float) -> None:
    channel = np.random.default_rng(0).uniform(0, 1, size).astype(np.float32)
    wanted = ndimage.gaussian_filter(channel.astype(float), sigma, order=order, mode="nearest")
    np.testing.assert_allclose(gaussian(channel, sigma, order), wanted, atol=1e-6)


def test_derivatives_of_a_parabola_are_exact_away_from_the_frame() -> None:
    y, x = np.mgrid[:40, :50].astype(float)
    channel = 0.5 * x**2 + 0.25 * x * y
    inside = np.s_[8:-8, 8:-8]
    np.testing.assert_allclose(gaussian(channel, 1.5, (0, 1))[inside], (x + 0.25 * y)[inside], rtol=1e-3)
    np.testing.assert_allclose(gaussian(channel, 1.5, (1, 1))[inside], 0.25, rtol=2e-3)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("window", [1, 3, 7, 21])
def test_box_means_are_scipys(size: tuple[int, int], window: int) -> None:
    channel = np.random.default_rng(0).uniform(0, 65025, size)
    wanted = ndimage.uniform_filter(channel, window, mode="nearest")
    np.testing.assert_allclose(box_mean(channel, window), wanted, rtol=1e-12)
