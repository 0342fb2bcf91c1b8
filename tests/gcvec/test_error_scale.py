"""From squared errors in [0, 1] to mean squared errors on the 0-255 scale, and back."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.error_scale import PEAK_SQUARE, square_of, told_mse


def test_the_same_error_on_both_scales() -> None:
    levels = np.random.default_rng(0).normal(0, 9, (40, 3))
    square, mse = float(((levels / 255) ** 2).sum()), float((levels**2).mean())
    assert told_mse(square, levels.size) == pytest.approx(mse)
    assert square_of(mse, levels.size) == pytest.approx(square)


def test_white_for_black_is_the_largest_error() -> None:
    assert told_mse(30.0, 30) == PEAK_SQUARE == 65025
    assert square_of(PEAK_SQUARE, 30) == 30.0
