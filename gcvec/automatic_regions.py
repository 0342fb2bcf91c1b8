"""Which regions a picture is divided into where nobody has drawn any."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.options import Options
from gcvec.refinement.seeding import expected_points
from gcvec.regions.partition import Partition
from gcvec.regions.segment import CLEAR_STEP, segment

EXPECTED = 0.55
"""Automatic regions are divided until each is expected to need no more than this share of the points it may
have: what is expected is often too little."""

PIXELS_A_REGION = 1500
"""On that account no more than one region for so many pixels."""

BYTES_A_REGION = 350
"""No more automatic regions than this leaves room for in a file of a given size: three times what each
takes."""


def automatic_regions(pixels: NDArray[np.uint8], options: Options) -> Partition:
    """As many regions as the options say, else as pay for themselves, and as hold the points that the picture
    is expected to need."""
    if options.regions:
        return segment(pixels, options.regions)
    if options.max_points:
        need = expected_points(np.divide(pixels, np.float32(255)), options.target_mse)
        most = max(EXPECTED * options.max_points, need.sum() * PIXELS_A_REGION / need.size)
        found = segment(pixels, 0, CLEAR_STEP, need, most)
    else:
        found = segment(pixels, 0, CLEAR_STEP)
    affordable = max(options.target_bytes // BYTES_A_REGION, 1)
    too_many = options.target_bytes and len(found.names) > affordable
    return segment(pixels, affordable) if too_many else found
