"""The first interior control points, placed at once where the picture bends.

A linear interpolant on triangles of area A misses a function with second derivatives H by about |H| A, so an
even error asks for a density of control points in proportion to |H|^(2/3) (Nadler 1986). Error diffusion
turns the density into points (Floyd and Steinberg 1976; for meshes Yang, Wernick and Brankov 2003). Rounds of
refinement that would find most of these points one after another are saved.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.grouping import rank_in_group
from gcvec.kernels import kernel
from gcvec.smoothing import box_mean, gaussian

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FEWEST_PER_BEND, POINTS_PER_BEND = 0.05, 0.12
"""Points a pixel for |H| = 1, in units of the root of the wanted mean squared error per pixel squared: few
enough that few turn out to be of little use; and fewer where a picture needs few, since most of what bends
there is noise."""

SEEDED = 0.35
"""About this share of the points that the picture will need are placed at once."""

NEARBY = 31
"""Pixels across the surroundings that tell how many points a place will need."""

SPARSE, DENSE = 0.01, 0.03
"""Fewer than so many points a pixel, by the lower factor, call for the lower one, and more for the higher."""

LEAST_BEND = 0.4
"""Where |H| is less than this, in the same units, no point is needed for a long way."""

LEAST_MSE = 1e-6
"""For a smaller error there are no more points: whatever bends at all calls for all it may have."""

MOST_POINTS = 0.2
"""Points a pixel, at most."""


def find_seeds(
    residual: NDArray[np.floating],
    target_mse: float,
    blocked: NDArray[np.bool_],
    patch_at: Ints,
    max_points: int,
) -> Ints:
    """First control points `(n, 2)`, by rows, for what the patches without any miss, `(h, w, 3)` in [0, 1].

    `target_mse` is on the 0-255 scale; pixels that are `blocked` `(h, w)` get no point. `patch_at` `(h, w)`
    is each pixel's patch, which gets about half of its `max_points` at most; 0 lifts the bound.
    """
    bent = _bent(residual, target_mse)
    density = np.minimum(gaussian(bent * _points_per_bend(bent.mean()), 1.0), MOST_POINTS)
    if max_points:
        expected = np.bincount(patch_at.ravel(), density.ravel())
        density *= np.minimum(1, max_points / 2 / np.maximum(expected, 1e-9))[patch_at]
    ys, xs = np.nonzero(_diffused(density, blocked))
    points = np.stack([xs, ys], axis=1).astype(np.int64)
    return points[rank_in_group(patch_at[ys, xs]) < max_points] if max_points else points


def expected_points(picture: NDArray[np.floating], target_mse: float) -> Floats:
    """About how many control points each pixel of a picture `(h, w, 3)` in [0, 1] will have in the end, for a
    mean squared error of `target_mse` (0-255 scale), if none of what bends is on a border: `(h, w)`."""
    bent = _bent(picture, target_mse)
    density = bent * _points_per_bend(box_mean(bent, NEARBY))
    return np.asarray(np.minimum(density, MOST_POINTS) / SEEDED)


def _bent(picture: NDArray[np.floating], target_mse: float) -> Floats:
    """|H|^(2/3), in units of the error wanted, as far as it calls for points `(h, w)`."""
    bend = np.sqrt(np.mean([_second_derivatives(picture[..., k]) for k in range(3)], axis=0))
    bend *= 255 / np.sqrt(max(target_mse, LEAST_MSE))
    return np.asarray(np.maximum(bend ** (2 / 3) - LEAST_BEND ** (2 / 3), 0.0), np.float64)


def _points_per_bend(bent: Floats) -> Floats:
    """By how much of it there is around."""
    return np.interp(FEWEST_PER_BEND * bent, (SPARSE, DENSE), (FEWEST_PER_BEND, POINTS_PER_BEND))


def _second_derivatives(channel: NDArray[np.floating]) -> Floats:
    """Squared Frobenius norm of the Hessian of a slightly smoothed picture `(h, w)`."""
    xx, xy, yy = (gaussian(channel, 1.0, order) for order in ((0, 2), (1, 1), (2, 0)))
    return np.asarray(xx**2 + 2 * xy**2 + yy**2)


@kernel
def _diffused(density, blocked):
    """Points `(h, w)` of a density below 1: Floyd-Steinberg error diffusion on a serpentine path.

    What falls on blocked pixels is handed on to those around.
    """
    height, width = density.shape
    points = np.zeros((height, width), np.bool_)
    row, below = np.zeros(width + 2), np.zeros(width + 2)
    for y in range(height):
        ahead = 1 if y % 2 == 0 else -1
        for i in range(width):
            x = i if ahead == 1 else width - 1 - i
            wanted = density[y, x] + row[x + 1]
            points[y, x] = wanted >= 0.5 and not blocked[y, x]
            error = wanted - 1.0 if points[y, x] else wanted
            row[x + 1 + ahead] += error * 7 / 16
            below[x + 1 - ahead] += error * 3 / 16
            below[x + 1] += error * 5 / 16
            below[x + 1 + ahead] += error * 1 / 16
        row, below = below, row
        below[:] = 0.0
    return points
