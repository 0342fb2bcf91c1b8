"""The steps in which a file stores positions and colours."""

from __future__ import annotations

from dataclasses import dataclass, replace

UNITS = 16320
"""Units of a colour step from 0 to 1: 64 to a level of 255."""


@dataclass(frozen=True)
class Quantization:
    """Steps of a file, as it stores them.

    Curve control points lie on a grid of 2^-`position_bits` pixels. `boundary_step` and `point_step` are the
    usual steps of colour differences on curves and at interior control points, in units of 1 / `UNITS`: that
    of one colour is smaller or larger by its stride (`gcvec.codec.strides`).
    """

    position_bits: int = 4
    boundary_step: int = 128
    point_step: int = 128

    @classmethod
    def of_colors(cls, step: float) -> Quantization:
        """Steps of all colours that are about `step`, for colours in [0, 1]."""
        units = max(round(step * UNITS), 1)
        return cls(boundary_step=units, point_step=units)

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
