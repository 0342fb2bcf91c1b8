"""What refinement starts from, and what it has to come to: whichever way it goes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.options import Options
from gcvec.patches.canonical import Foundation
from gcvec.quantization import Quantization


@dataclass(frozen=True)
class Scene:
    """A photo whose regions have their curves, and no interior control points yet.

    pixels           (h, w, 3) uint8, the photo
    foundation       curves, parameter domains and S
    boundary_colors  (b, 3) float64 in [0, 1], their first estimates (section 4.3)
    labels           names of the regions
    """

    pixels: NDArray[np.uint8]
    foundation: Foundation
    boundary_colors: NDArray[np.float64]
    labels: tuple[str, ...] = ()


@dataclass(frozen=True)
class Terms:
    """What a picture has to come to.

    target_mse  the mean squared error of what its file holds (0-255 scale)
    steps       those of the file: colours are rounded to about these
    max_points  bound of the interior control points of one region, 0: none
    effort      1 to 9, trades time for fewer control points
    """

    target_mse: float
    steps: Quantization
    max_points: int
    effort: int = Options.effort
