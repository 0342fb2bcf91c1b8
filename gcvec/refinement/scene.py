"""What refinement starts from, what it has to come to and what it tells: whichever way it goes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.options import Options
from gcvec.patches.canonical import Foundation


@dataclass(frozen=True)
class Scene:
    """A photo whose regions have their curves, and no interior control points yet.

    pixels           (h, w, 3) uint8, the photo
    foundation       curves, parameter domains and S
    boundary_colors  (b, 3) float64 in [0, 1], their first estimates (section 4.3)
    names            of the regions
    """

    pixels: NDArray[np.uint8]
    foundation: Foundation
    boundary_colors: NDArray[np.float64]
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Terms:
    """What a picture has to come to.

    target_mse  the mean squared error of what its file holds (0-255 scale)
    max_points  bound of the interior control points of one region, 0: none
    effort      1 to 9, trades time for a smaller file
    axes        of colour along which the picture varies: 1 where it is grey, else 3
    """

    target_mse: float
    max_points: int
    effort: int = Options.effort
    axes: int = 3


@dataclass(frozen=True)
class Start:
    """Where a refinement goes on that others have begun.

    points  (n, 2) int64, control points, by rows
    colors  (b + n, 3) float64, all colours, boundary first
    rounds  how many there have been
    lack    how much of the error there is because regions may have no more points
    rise    see `Refinement`: 0 where it is not known
    """

    points: NDArray[np.int64]
    colors: NDArray[np.float64]
    rounds: int
    lack: float = 0.0
    rise: float = 0.0


@dataclass(frozen=True)
class Iteration:
    """What a round, or with the paper's strategy a further point, has come to.

    Errors are on the 0-255 scale; `grown` are the regions that got points, and `left` is how many rounds are
    planned after it, None while nobody knows.
    """

    number: int
    points: int
    worst_region: int
    worst_error: float
    mse: float
    grown: frozenset[int]
    left: int | None = None
