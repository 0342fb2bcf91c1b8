"""What regions get for their control points: where an error cannot be reached, more of them are not better.

A region may go back to its best bargain while the others keep what they have.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LEAST_RETURN = 0.25
"""An error that falls by less than this power of the number of points is not worth them."""

FEW_A_PIXEL = 1 / 32
"""With this many points a pixel or fewer nobody asks whether they are worth it."""


class Bargains(NamedTuple):
    """What each region gets for its control points.

    score   (r,) squared error times a small power of the number of points: the lower, the better a bargain
    points  (n, 2) int64, the points of all regions
    colors  (n, 3) theirs
    region  (n,) theirs
    """

    score: Floats
    points: Ints
    colors: Floats
    region: Ints

    def except_in(self, chosen: NDArray[np.bool_], other: Bargains) -> Bargains:
        """These, but the other's in the regions `chosen` `(r,)`."""
        kept, taken = ~chosen[self.region], chosen[other.region]
        return Bargains(
            np.where(chosen, other.score, self.score),
            np.concatenate([self.points[kept], other.points[taken]]),
            np.concatenate([self.colors[kept], other.colors[taken]]),
            np.concatenate([self.region[kept], other.region[taken]]),
        )

    def better_of(self, before: Bargains | None) -> Bargains:
        """The better bargain of each region, that of `before` where they are equal."""
        return self if before is None else self.except_in(~(self.score < before.score), before)


def bargains(squares: Floats, areas: Ints, points: Ints, colors: Floats, region: Ints) -> Bargains:
    """The bargains of regions with these squared errors and `areas`, in pixels, `(r,)` each; for `points`,
    `colors` and `region` see `Bargains`."""
    n_points = np.maximum(np.bincount(region, minlength=len(areas)), FEW_A_PIXEL * areas)
    return Bargains(squares * n_points**LEAST_RETURN, points, colors, region)
