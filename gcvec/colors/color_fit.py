"""Colours by least squares on blended pixels, equation (7)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.colors.least_squares import NormalEquations, from_pixels, misfit
from gcvec.patches.canonical import Canvas
from gcvec.raster.coverage import Coverage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class ColorFit:
    """Equation (7) on one canvas: ŷ = B R x; R takes the unknowns to the mesh, B the mesh to pixels."""

    operator: sparse.csr_array
    design: sparse.csr_array
    target: Floats

    @cached_property
    def columns(self) -> sparse.csc_array:
        """B by columns: what each colour on the mesh gives to the pixels."""
        return self.design.tocsc()

    @classmethod
    def to(cls, operator: sparse.csr_array, design: sparse.csr_array, truth: NDArray[np.float32]) -> ColorFit:
        """The fit of B R x to pixels `(pixels, 3)`."""
        return cls(operator, design, operator.T @ from_pixels(design, truth))

    def of(self, truth: NDArray[np.float32]) -> ColorFit:
        """The same fit to other pixels `(pixels, 3)`."""
        return ColorFit.to(self.operator, self.design, truth)

    def equations(self, prior: Floats, pull: Floats) -> NormalEquations:
        """Normal equations with every unknown pulled towards `prior` `(n, 3)` with weight `pull` `(n,)`."""
        return NormalEquations(self.operator, self.design, pull, self.target + pull[:, None] * prior)

    def residual(self, colors: Floats, truth: NDArray[np.float32]) -> NDArray[np.float32]:
        """What ŷ lacks to the pixels `truth` `(pixels, 3)`."""
        return misfit(self.design, self.operator @ colors, truth)


def color_fit(canvas: Canvas, coverage: Coverage, truth: NDArray[np.float32]) -> ColorFit:
    """The fit of a canvas, whose drawing covers the pixels so, to the pixels `truth` `(pixels, 3)`."""
    _, operator, corner_color = canvas.unit
    design = coverage.matrix(corner_color, operator.shape[0])
    return ColorFit.to(operator, design, truth)
