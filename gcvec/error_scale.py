"""Errors are computed with colours in [0, 1], and told on the 0-255 scale."""

from __future__ import annotations

PEAK_SQUARE = 255**2
"""The square of the largest difference on the 0-255 scale: of squared errors there to those in [0, 1]."""


def told_mse(square: float, n_values: int) -> float:
    """The mean squared error on the 0-255 scale of a squared error in [0, 1], summed over so many values:
    pixels times channels."""
    return square * PEAK_SQUARE / n_values


def square_of(mse: float, n_values: int) -> float:
    """The squared error in [0, 1], summed over so many values, of a mean squared error on the 0-255 scale."""
    return mse * n_values / PEAK_SQUARE
