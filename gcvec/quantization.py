"""The steps in which a file stores positions and colours."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

UNITS = 4080
"""Units of a colour step from 0 to 1: sixteen to a level of 255."""


@dataclass(frozen=True)
class Quantization:
    """Steps of a file, as it stores them.

    Curve control points lie on a grid of 2^-`position_bits` pixels. `boundary_step` and `point_step` are the
    steps of colour differences on curves and at interior control points, in units of 1 / `UNITS`.
    """

    position_bits: int = 4
    boundary_step: int = 64
    point_step: int = 64

    @classmethod
    def for_error(cls, target_mse: float, axes: int = 3) -> Quantization:
        """Steps whose rounding takes a small share of a mean squared error (0-255 scale).

        At an error of 5 a step is 64 units, 4 levels: rounding to the nearest gives 4²/12, about a quarter of
        the error, and the same share of any other within half a level and 16 of them. Steps may be larger
        where colours vary along fewer axes than three: that adds as much error.
        """
        step = int(np.clip(round(64 * (target_mse / 5 * 3 / axes) ** 0.5), 8, 256))
        return cls(boundary_step=step, point_step=step)

    def scaled(self, factor: float) -> Quantization:
        """The same with colour steps that are larger by this factor, or the smallest there are."""
        return replace(
            self,
            boundary_step=max(round(self.boundary_step * factor), 1),
            point_step=max(round(self.point_step * factor), 1),
        )

    @property
    def grid(self) -> float:
        """Grid of curve control points, pixels."""
        return 0.5**self.position_bits

    @property
    def boundary(self) -> float:
        """Step of boundary colours, for colours in [0, 1]."""
        return self.boundary_step / UNITS

    @property
    def point(self) -> float:
        """Step of interior colours, for colours in [0, 1]."""
        return self.point_step / UNITS
