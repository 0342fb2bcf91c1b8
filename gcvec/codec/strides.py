"""How coarsely the colours of a picture are stored: the less of it one of them colours, the coarser.

Rounding a colour adds to the squared error by the energy of its blending function. Of all steps that come to
one error, those take the fewest bits with which every colour adds the same (Gersho and Gray, "Vector
Quantization and Signal Compression", section 8.3): they go with one over the root of the energy, which itself
goes with the area that the function covers.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.colors import FRACTION
from gcvec.patches.canonical import Canvas

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

COARSEST_STRIDE, COARSEST_BOUNDARY_STRIDE = 96, 64
"""Strides are 1 to the first, those of boundary colours to the second: errors along edges are seen. All
numbers here are part of the format: others make other files."""

FIRST_STRIDE = 2
"""The first boundary colour of a patch has no larger one: what predicts all others of a flat patch is to be
as good as the best of them, or they would differ."""

MOST_CROWDED = 31

USUAL_AREA = 64
"""A control point among so many square pixels of triangles has the stride `FRACTION`: one whole step."""

_AREAS = 256
"""Areas count in this share of a square pixel."""

_BOUNDARY_SHARE = 2
"""The blending functions of boundary colours overlap, and end at the curve: for one area they have about this
many times less energy."""


class Strides(NamedTuple):
    """By how many sixteenths of a step the differences of each colour count.

    boundary  (b,) int64, of the boundary unknowns
    points    (n,) int64, of the interior control points
    """

    boundary: Ints
    points: Ints


def strides(canvas: Canvas) -> Strides:
    """Those of the colours of a canvas."""
    areas, n_boundary = _areas(canvas), canvas.foundation.space.size
    return Strides(
        _strides(areas[:n_boundary] // _BOUNDARY_SHARE, COARSEST_BOUNDARY_STRIDE),
        _strides(areas[n_boundary:], COARSEST_STRIDE),
    )


def crowds_by_stride(strides: Ints) -> Ints:
    """How dense control points are around those of the strides `(n,)`, from 0 to `MOST_CROWDED`."""
    return np.minimum(strides, MOST_CROWDED)


def _strides(areas: Ints, coarsest: int) -> Ints:
    coarse = FRACTION * np.sqrt(USUAL_AREA * _AREAS / np.maximum(areas, 1))
    return np.clip(np.floor(coarse + 0.5), 1, coarsest).astype(np.int64)


def _areas(canvas: Canvas) -> Ints:
    """The triangles around the vertices, as far as their colours are those of each unknown `(b + n,)`.

    Free vertices are left out: a decoder may differ in the last bits of what they are blended of.
    """
    corners = canvas.corner_colors
    _, operator, _ = canvas.unit
    around = np.bincount(corners.ravel(), _corner_areas(canvas).ravel(), operator.shape[0])
    n_points, n_inside = canvas.mesh.n_points, len(canvas.mesh.vertices) - canvas.mesh.n_samples
    around[n_points:n_inside] = 0
    shares = np.floor(operator.data * np.repeat(around, np.diff(operator.indptr)) + 0.5)
    return np.bincount(operator.indices, shares, operator.shape[1]).astype(np.int64)


def _corner_areas(canvas: Canvas) -> Floats:
    """The area of every triangle as each of its corners finds it `(t, 3)`, whole numbers of `_AREAS`."""
    mesh = canvas.mesh
    corners = mesh.vertices[mesh.triangles]
    ahead, behind = (np.roll(corners, -k, axis=1) - corners for k in (1, 2))
    double = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    return np.floor(_AREAS / 2 * double + 0.5)
