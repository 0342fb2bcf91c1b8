"""Ends of strokes: where a region too thin for two corners to be seen one by one turns back.

Its two long sides are known well, and how far it reaches shows along its axis; the short side between them is
no longer than the staircase of a label map is wide.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.chains import Chains
from gcvec.borders.line_fit import fit_line
from gcvec.borders.profile import step_shifts
from gcvec.kernels import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIDE = 4
"""Samples of a long side."""

GAP = 1
"""Samples next to the corners that belong to no side: the photo's blur rounds them."""

LONGEST = 7
"""Samples of the short side at most: a stroke of five pixels has as many across the steepest staircase."""

LEAST_WIDTH, LARGEST_WIDTH = 0.75, 5.0
"""Of a stroke, pixels. Wider ones have corners of their own."""

LARGEST_TAPER = np.deg2rad(25.0)
"""The long sides make an angle no larger: the end of a wedge is a tip."""

LARGEST_ERROR = 0.08
"""Root mean square of the distances between the samples of a long side and its line, pixels."""

LEAST_TRUST, LARGEST_SHIFT = 0.5, 0.6
"""In the step at the end of a stroke, and how far that may be from where the border turns, pixels: a stroke
that fades out, or tapers off, has no corners."""

NEAR = 1.0
"""So far from a corner, pixels, the border may be cut for it."""


class StrokeEnds(NamedTuple):
    """Samples after which a border turns at the ends of strokes, `(n, 2)`, and the corners' places,
    `(n, 2, 2)`."""

    after: Ints
    places: Floats


def stroke_ends(chains: Chains, points: Floats, picture: Floats, largest_shift: float) -> StrokeEnds:
    """The ends of strokes along the chains through `points` `(n, 2)`.

    The picture shows that they end there, and how far they reach: up to `largest_shift` pixels further or
    less far than the points.
    """
    first, count, tip, axis, half = _ends(points, chains.offsets, chains.closed)
    shift, trust, _ = step_shifts(picture, tip, axis, np.zeros((len(tip), 2), bool))
    seen = (np.abs(shift) < LARGEST_SHIFT) & (trust > LEAST_TRUST)
    first, count, tip, axis, half = (found[seen] for found in (first, count, tip, axis, half))
    tip = tip + np.clip(shift[seen], -largest_shift, largest_shift)[:, None] * axis
    begin = chains.first[first]
    last = begin + (first - begin + count) % chains.size[first]
    return StrokeEnds(np.stack([first, last], axis=1), np.stack([tip - half, tip + half], axis=1))


@kernel
def _ends(points, offsets, closed):
    """The samples after which short sides begin, `(n,)`, and how many they have; their middles, the ways that
    the strokes point, and half of their widths, `(n, 2)` each."""
    n = len(points)
    misfit, count = np.full(n, np.inf), np.zeros(n, np.int64)
    tip, axis, half = np.zeros((n, 2)), np.zeros((n, 2)), np.zeros((n, 2))
    reach = GAP + SIDE
    own, found = np.empty((2 * reach + LONGEST, 2)), np.empty((3, 2))
    for chain in range(len(closed)):
        first, size = offsets[chain], offsets[chain + 1] - offsets[chain]
        for short in range(1, LONGEST + 1):
            # On open chains both ends are nodes, which belong to no side.
            start, stop = reach, size - reach - short - 1
            if closed[chain]:
                start, stop = 0, size if size >= 2 * reach + short else 0
            for k in range(start, stop):
                for i in range(2 * reach + short):
                    own[i] = points[first + (k - reach + 1 + i) % size]
                off = _misfit(own[: 2 * reach + short], found)
                if off < misfit[first + k]:
                    misfit[first + k], count[first + k] = off, short
                    tip[first + k], axis[first + k], half[first + k] = found[0], found[1], found[2]
    kept = _best_apart(misfit, offsets)
    return kept, count[kept], tip[kept], axis[kept], half[kept]


@kernel
def _misfit(points, found):
    """How far from the corners of a stroke's end, pixels, the samples `(k, 2)` turn that would be a long
    side, a short one and a long one; infinite if they are no such thing.

    Fills `found` `(3, 2)` with the middle of the short side, the way that the stroke points, and half of its
    width.
    """
    u, v, a, b = np.empty(2), np.empty(2), np.empty(2), np.empty(2)
    left = max(fit_line(points[:SIDE], u, a), fit_line(points[-SIDE:], v, b))
    if left > SIDE * LARGEST_ERROR**2 or u[0] * v[0] + u[1] * v[1] > -np.cos(LARGEST_TAPER):
        return np.inf
    length = np.hypot(u[0] - v[0], u[1] - v[1])
    x, y = (u[0] - v[0]) / length, (u[1] - v[1]) / length
    # How far the short side reaches along the axis, and the points of the long ones there.
    far = -np.inf
    for i in range(SIDE + GAP, len(points) - SIDE - GAP):
        far = max(far, points[i, 0] * x + points[i, 1] * y)
    s = (far - a[0] * x - a[1] * y) / (u[0] * x + u[1] * y)
    t = (far - b[0] * x - b[1] * y) / (v[0] * x + v[1] * y)
    if s < 0 or t > 0:
        return np.inf
    off = 0.0
    for c in range(2):
        u[c], v[c] = a[c] + s * u[c], b[c] + t * v[c]
        found[0, c], found[2, c] = (u[c] + v[c]) / 2, (v[c] - u[c]) / 2
    found[1, 0], found[1, 1] = x, y
    width = np.hypot(v[0] - u[0], v[1] - u[1])
    if width < LEAST_WIDTH or width > LARGEST_WIDTH:
        return np.inf
    for corner, k in ((u, SIDE + GAP - 1), (v, len(points) - SIDE - GAP - 1)):
        x = (points[k, 0] + points[k + 1, 0]) / 2 - corner[0]
        y = (points[k, 1] + points[k + 1, 1]) / 2 - corner[1]
        distance = np.hypot(x, y)
        if distance > NEAR:
            return np.inf
        off += distance
    return off


@kernel
def _best_apart(misfit, offsets):
    """Of short sides that may overlap those that fit best, by the samples after which they begin."""
    kept = np.zeros(len(misfit), np.bool_)
    for chain in range(len(offsets) - 1):
        first, size = offsets[chain], offsets[chain + 1] - offsets[chain]
        for k in range(size):
            kept[first + k] = np.isfinite(misfit[first + k])
            for i in range(1, min(LONGEST + GAP, (size - 1) // 2) + 1):
                before, after = misfit[first + (k - i) % size], misfit[first + (k + i) % size]
                kept[first + k] &= misfit[first + k] < before and misfit[first + k] <= after
    return np.flatnonzero(kept)
