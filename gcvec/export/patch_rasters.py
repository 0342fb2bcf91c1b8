"""Rasters of single patches' colours, each as coarse as its patch allows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil, log2

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from gcvec import raster
from gcvec.export.triangles import SCALE
from gcvec.vector_image import VectorImage, to_8_bit

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FINEST = 0.5
"""Pixels a side of the smallest samples."""

MOST_SAMPLES = 2**23
"""What a picture may have at the finest step; samples of larger pictures are larger."""

DOUBLINGS = 4
"""The coarsest samples are 2^4 times as long as the finest."""

TOLERANCE, TOLERANCE_THERE = 0.6 / 255, 3 / 255
"""Mean absolute difference to the finest raster that a coarser one may have: on all of the patch, and on any
square of `WINDOW` samples, lest what little detail a large smooth patch has be blurred."""

WINDOW = 64
"""Samples a side of those squares."""

MARGIN = 2
"""Samples beyond the patch on every side, for readers to interpolate with."""

REACH = 4.0
"""Samples nearer to the patch than this continue its colours; what lies beyond is never seen."""

LEAST = 1e-3
"""Of a sample the patch must cover more than this for the sample to have a colour."""


@dataclass(frozen=True)
class PatchRaster:
    """Colours of a patch, continued beyond its outline.

    x, y     place of the top-left corner, pixels
    step     pixels a side of a sample
    samples  (h, w, 3) uint8
    """

    x: float
    y: float
    step: float
    samples: NDArray[np.uint8]


def patch_rasters(image: VectorImage) -> Iterator[PatchRaster]:
    """One raster a patch: the coarsest that, interpolated, is as good as the finest."""
    drawing = image.canvas.drawing(1 / SCALE)
    operator, corner_color = image.canvas.operator(drawing)
    colors = np.clip(operator @ image.colors, 0, 1)
    too_many = image.width * image.height / FINEST**2 / MOST_SAMPLES
    finest = FINEST * 2 ** max(0, ceil(log2(too_many) / 2))
    for patch in range(len(image.labels)):
        own = drawing.patch == patch
        painter = _Painter(drawing.image, drawing.triangles[own], colors, corner_color[own])
        yield _coarsest(painter, finest)


def _coarsest(painter: _Painter, finest: float) -> PatchRaster:
    fine = painter.paint(finest)
    for doublings in range(DOUBLINGS, 0, -1):
        coarse = painter.paint(finest * 2**doublings)
        off = _difference(coarse.colors, fine, 2**doublings)
        there = ndimage.uniform_filter(off, WINDOW, mode="constant")
        if off.sum() <= TOLERANCE * fine.covered.sum() and there.max() <= TOLERANCE_THERE:
            return coarse.rounded()
    return fine.rounded()


@dataclass(frozen=True)
class _Painted:
    """A raster before rounding; of the samples `covered` `(h, w) bool` the patch fills at least half, or as
    much as of any."""

    origin: Floats
    step: float
    colors: Floats
    covered: NDArray[np.bool_]

    def rounded(self) -> PatchRaster:
        return PatchRaster(float(self.origin[0]), float(self.origin[1]), self.step, to_8_bit(self.colors))


def _difference(coarse: Floats, fine: _Painted, ratio: int) -> Floats:
    """`(h, w)` absolute difference, the mean of its channels, between the finest raster and an interpolated
    coarser one: 0 beyond the patch."""
    between = ndimage.zoom(coarse, (ratio, ratio, 1), order=1, mode="nearest", grid_mode=True)
    # Both have the same number of samples beyond the patch.
    first = MARGIN * (ratio - 1)
    height, width = fine.covered.shape
    between = between[first : first + height, first : first + width]
    return np.asarray(np.abs(between - fine.colors).mean(axis=2) * fine.covered)


class _Painter:
    """The triangles `(t, 3)` of one patch, corners coloured by `colors[corner_color]`."""

    def __init__(self, places: Floats, triangles: Ints, colors: Floats, corner_color: Ints) -> None:
        self.triangles = np.arange(triangles.size).reshape(-1, 3)
        self.places = places[triangles].reshape(-1, 2)
        self.colors = np.insert(colors[corner_color].reshape(-1, 3), 3, 1.0, axis=1)
        self.low = np.floor(self.places.min(axis=0))
        self.extent = np.ceil(self.places.max(axis=0)) - self.low

    def paint(self, step: float) -> _Painted:
        origin = self.low - MARGIN * step
        width, height = np.ceil(self.extent / step).astype(int) + 2 * MARGIN
        vertices = (self.places - origin) / step
        painted = raster.paint(vertices, self.triangles, self.colors, self.triangles, width, height)
        coverage = painted[..., 3]
        if not (coverage > LEAST).any():  # an edit may have turned all of it over
            painted[:] = self.colors.mean(axis=0)
        return _Painted(origin, step, _continued(painted), coverage >= min(0.5, coverage.max()))


def _continued(painted: Floats) -> Floats:
    """Colours `(h, w, 3)` of a raster whose fourth channel is coverage, continued beyond what is covered."""
    coverage = painted[..., 3]
    covered = coverage > LEAST
    distance, (row, column) = ndimage.distance_transform_edt(~covered, return_indices=True)
    colors = painted[row, column, :3] / coverage[row, column, None]
    colors[distance > REACH] = colors[covered].mean(axis=0)
    return np.asarray(colors)
