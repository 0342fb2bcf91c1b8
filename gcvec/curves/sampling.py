"""Where curves are sampled for meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.spline_family import SplineFamily

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SPACING = 3.0
SAGITTA = 0.05
"""Consecutive samples are at most this far apart, and the curve at most this far from their chord, pixels."""

MOST_PIECES = 64
"""A segment takes no more pieces. Curves fitted to borders need far fewer: a file that asks for more is
damaged."""


@dataclass(frozen=True)
class Sampling:
    """Samples of all curves, one curve after another, both ends of each included.

    starts   (c + 1,) where each curve's samples begin
    curve    (n,) the curve of a sample
    u        (n,) its parameter
    points   (n, 2) its place, pixels
    control  (n, 4) the control points that make it up, counted through all curves
    weight   (n, 4) their weights
    """

    starts: Ints
    curve: Ints
    u: Floats
    points: Floats
    control: Ints
    weight: Floats


def sampling(family: SplineFamily, control_points: Floats) -> Sampling:
    """Sample curves: every segment in 2^k equal pieces, k as spacing and sagitta ask for.

    `ValueError` where a segment would take more than `MOST_PIECES`.
    """
    corners = family.bezier(control_points)
    span = np.hypot(*(corners[:, 3] - corners[:, 0]).T)
    fine = np.maximum(span / SPACING, np.sqrt(family.bend(control_points) / (8 * SAGITTA)))
    pieces = 2 ** np.ceil(np.log2(np.maximum(fine, 1)) - 1e-6).astype(np.int64)
    if pieces.max() > MOST_PIECES:
        raise ValueError("a curve with a segment too long or too bent")
    # The end of each curve is like one more segment, of one piece.
    ends = family.first_segment[1:]
    pieces = np.insert(pieces, ends, 1)
    owner = np.repeat(np.arange(len(ends)), family.segments + 1)
    segment = np.arange(len(owner)) - (family.first_segment[:-1] + np.arange(len(ends)))[owner]
    within = np.arange(pieces.sum()) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    curve = np.repeat(owner, pieces)
    u = np.repeat(segment, pieces) + within / np.repeat(pieces, pieces)
    control, weight = family.basis(curve, u)
    parts = weight[:, :, None] * control_points[control]
    # In the order that the file's format asks for.
    points = parts[:, 0] + parts[:, 1] + parts[:, 2] + parts[:, 3]
    starts = np.searchsorted(curve, np.arange(len(ends) + 1))
    return Sampling(starts, curve, u, points, control, weight)
