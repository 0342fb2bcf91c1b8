"""Which regions a picture is divided into where nobody has drawn any."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.options import Options
from gcvec.refinement.seeding import expected_points
from gcvec.refinement.to_bytes import POINTS_A_BYTE, USUAL_MSE
from gcvec.regions.partition import Partition
from gcvec.regions.segment import CLEAR_STEP, segment

EXPECTED = 0.55
"""Automatic regions are divided until each is expected to need no more than this share of the points it may
have: what is expected is often too little."""

PIXELS_A_REGION = 1500
"""On that account no more than one region for so many pixels."""

FLAT_MSE = 150.0
"""A picture is flat if one colour a region leaves no more than this mean squared error (0-255 scale) inside
its regions."""

BYTES_A_CRACK = 0.27
"""What the side of a pixel along a border takes in the file of a flat picture."""

STEP_POWER = 0.4
"""The step that is worth a border grows with this power of how many times the bytes given a picture needs:
the larger the error elsewhere, the more of it the same bytes save there."""


def automatic_regions(pixels: NDArray[np.uint8], options: Options) -> Partition:
    """As many regions as the options say, else as pay for themselves, and as hold the points that the picture
    is expected to need."""
    if options.regions:
        return segment(pixels, options.regions)
    if options.target_bytes:
        return _regions_for_bytes(pixels, options.target_bytes, options.max_points)
    if not options.max_points:
        return segment(pixels, 0, CLEAR_STEP)
    need = needed_points(pixels, options.target_mse)
    return segment(pixels, 0, CLEAR_STEP, need, _most(need, options.max_points))


def _regions_for_bytes(pixels: NDArray[np.uint8], target_bytes: int, max_points: int) -> Partition:
    """Of a flat picture all regions whose borders fit; of any other those within the clearest borders, the
    clearer the fewer bytes there are."""
    need = needed_points(pixels, USUAL_MSE)
    step, border, left = CLEAR_STEP, np.inf, float(target_bytes)
    found = segment(pixels, 0, step)
    if _error_of_means(pixels, found.labels) < FLAT_MSE:
        border = target_bytes / BYTES_A_CRACK
        left = max(left - BYTES_A_CRACK * _cracks(found.labels), 0.0)
    else:
        step *= max(need.sum() / (POINTS_A_BYTE * target_bytes), 1.0) ** STEP_POWER
    need *= min(POINTS_A_BYTE * left / max(need.sum(), 1.0), 1.0)
    return segment(pixels, 0, step, need, _most(need, max_points), border)


def needed_points(pixels: NDArray[np.uint8], target_mse: float) -> NDArray[np.float64]:
    """`expected_points` of pixels `(h, w, 3) uint8`."""
    return expected_points(np.divide(pixels, np.float32(255)), target_mse)


def _most(need: NDArray[np.float64], max_points: int) -> float:
    """The points that a region may be expected to need."""
    if not max_points:
        return np.inf
    return max(EXPECTED * max_points, float(need.sum()) * PIXELS_A_REGION / need.size)


def _cracks(labels: NDArray[np.int32]) -> int:
    """The length of all borders, in sides of pixels."""
    return int((labels[1:] != labels[:-1]).sum() + (labels[:, 1:] != labels[:, :-1]).sum())


def _error_of_means(pixels: NDArray[np.uint8], labels: NDArray[np.int32]) -> float:
    """The mean squared error (0-255 scale) of pixels within regions, none of another beside them, where the
    mean colour of those in a region stands for all."""
    inside = np.ones(labels.shape, np.bool_)
    for here, there in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        same = labels[here] == labels[there]
        inside[here] &= same
        inside[there] &= same
    regions, colors = labels[inside], pixels[inside].astype(np.float64)
    areas = np.maximum(np.bincount(regions), 1)
    square = 0.0
    for values in colors.T:
        square += float((values**2).sum() - (np.bincount(regions, values) ** 2 / areas).sum())
    return square / max(colors.size, 1)
