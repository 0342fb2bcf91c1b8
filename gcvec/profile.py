"""Where across a line the photo changes from one side's colour to the other's."""

from __future__ import annotations

import numpy as np
from numba import njit

REACH = 2.5
"""The profile is read this far to either side, pixels."""

LEAST_STEP, SURE_STEP = 0.02, 0.06
"""Distances between the colours of both sides, of colours in [0, 1], below which a step is not trusted, and
above which it is wholly."""

LARGEST_SPREAD = 0.25
"""How far a side's own colours may spread, as a share of the step."""

UNEVEN = 0.3
"""What a sample counts where uneven sides hide where between two pixel centres the step lies."""


@njit(cache=True, nogil=True)
def _color_at(picture, x, y, out):
    """Bilinear interpolation between pixel centres, clamped at the frame."""
    height, width = picture.shape[:2]
    x = min(max(x - 0.5, 0.0), width - 1.0)
    y = min(max(y - 0.5, 0.0), height - 1.0)
    x0, y0 = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
    s, t = x - x0, y - y0
    for c in range(picture.shape[2]):
        top = (1 - s) * picture[y0, x0, c] + s * picture[y0, x1, c]
        bottom = (1 - s) * picture[y1, x0, c] + s * picture[y1, x1, c]
        out[c] = (1 - t) * top + t * bottom


@njit(cache=True, nogil=True)
def step_shifts(picture, points, normals):
    """How far along its normal from each point the step is, and how surely there is a step near, in [0, 1].

    NaN where that cannot be told: the sides are too much alike, or too uneven.
    """
    per_side = 10
    step = REACH / per_side
    n_profile = 2 * per_side + 1
    profile = np.empty((n_profile, 3))
    low, high = np.empty(3), np.empty(3)
    shift, trust = np.full(len(points), np.nan), np.zeros(len(points))
    for i in range(len(points)):
        for k in range(n_profile):
            offset = (k - per_side) * step
            _color_at(
                picture,
                points[i, 0] + offset * normals[i, 0],
                points[i, 1] + offset * normals[i, 1],
                profile[k],
            )
        flat = 5
        square, spread = 0.0, 0.0
        for c in range(3):
            low[c] = profile[:flat, c].mean()
            high[c] = profile[n_profile - flat :, c].mean()
            square += (high[c] - low[c]) ** 2
            for k in range(flat):
                spread += (profile[k, c] - low[c]) ** 2 + (profile[n_profile - 1 - k, c] - high[c]) ** 2
        if square < 3 * LEAST_STEP**2:
            continue
        trust[i] = min(np.sqrt(square / 3) / SURE_STEP, 1.0)
        if spread / (2 * flat) > LARGEST_SPREAD**2 * square:
            trust[i] *= UNEVEN
            continue
        # The share of the far colour, integrated over the profile, is the length that lies beyond the step.
        beyond = 0.0
        for k in range(n_profile):
            share = 0.0
            for c in range(3):
                share += (profile[k, c] - low[c]) * (high[c] - low[c])
            share = min(max(share / square, 0.0), 1.0)
            beyond += share * (0.5 if k == 0 or k == n_profile - 1 else 1.0) * step
        shift[i] = REACH - beyond
    return shift, trust
