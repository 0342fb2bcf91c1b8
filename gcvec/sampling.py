"""Where curves are sampled for meshes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec import bspline

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
    """Samples of one curve, both ends included: parameters `u` `(n,)` and `points` `(n, 2)`, pixels.

    `control` and `weight`, `(n, 4)` each, say which control points make up a sample.
    """

    u: Floats
    points: Floats
    control: Ints
    weight: Floats


def sampling(control_points: Floats, closed: bool) -> Sampling:
    """Sample a curve: every segment in 2^k equal pieces, k as spacing and sagitta ask for.

    `ValueError` where a segment would take more than `MOST_PIECES`.
    """
    segments = bspline.segments_of(control_points, closed)
    knots = bspline.evaluate(control_points, np.arange(segments + 1.0), closed)
    spans = np.hypot(*np.diff(knots, axis=0).T)
    bend = np.hypot(*bspline.second_derivative_at_knots(control_points, closed).T)
    fine = np.maximum(spans / SPACING, np.sqrt(np.maximum(bend[:-1], bend[1:]) / (8 * SAGITTA)))
    pieces = 2 ** np.ceil(np.log2(np.maximum(fine, 1)) - 1e-6).astype(np.int64)
    if pieces.max() > MOST_PIECES:
        raise ValueError("a curve with a segment too long or too bent")
    segment = np.repeat(np.arange(segments), pieces)
    within = np.arange(len(segment)) - np.repeat(np.cumsum(pieces) - pieces, pieces)
    u = np.append(segment + within / pieces[segment], float(segments))
    index, weight = bspline.basis(u, segments, closed)
    return Sampling(u, np.einsum("nk,nkd->nd", weight, control_points[index]), index, weight)
