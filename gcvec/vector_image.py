"""The result: a picture made of generalized Coons patches, which renders, saves, loads and describes
itself."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gcvec import raster
from gcvec.curves.network import Curve, Network
from gcvec.errors import InputError
from gcvec.patches.canonical import Canvas, Foundation, lay_canvas, lay_foundation
from gcvec.patches.drawing import FLATNESS
from gcvec.quantization import Quantization

if TYPE_CHECKING:
    from gcvec.codec.neighborhoods import Neighborhoods
    from gcvec.codec.strides import Strides
    from gcvec.metrics import Report
    from gcvec.recoloring import Recoloring

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_DRAWN = 2**31
"""A picture drawn has fewer: their numbers fit into 32 bits."""

BAND = 2**22
"""About so many pixels are drawn at once: what that takes does not grow with the picture."""

OVERSHOOT = 1 / 255
"""How far beyond black and white a colour is drawn, where rounding took it there. Channels are clipped only
once a pixel's mean is known: what lies further out would make pictures at different scales differ."""


@dataclass(frozen=True, eq=False)
class VectorImage:
    """A vector image: what a `.gcv` file holds, and all that follows from it.

    network          boundary curves and the loops they form around each patch
    hard             (c,) bool, the curves that carry two sets of colours
    boundary_colors  (b, 3) float64, colours of the boundary unknowns (see `color_space`): in [0, 1], but for
                     what rounding adds
    points           (n, 2) int64, interior control points as pixels of the parameter domain, by rows
    point_colors     (n, 3) float64, likewise
    labels           the label of each patch
    quantization     the steps in which its file stores all this
    control_points   (c, 2) float64, control points of all curves after an edit; None: those of the network
    recoloring       what the colours were made of where patches were recoloured; None: they were not
    region_warnings  what the annotations had that could not be used as it was, one line each
    result_warnings  what was asked for and has not been reached, one line each
    report           how close it comes to its photo; None where that is not known
    """

    network: Network
    hard: NDArray[np.bool_]
    boundary_colors: Floats
    points: Ints
    point_colors: Floats
    labels: tuple[str, ...]
    quantization: Quantization = field(default_factory=Quantization)
    control_points: Floats | None = None
    recoloring: Recoloring | None = None
    region_warnings: tuple[str, ...] = ()
    result_warnings: tuple[str, ...] = ()
    report: Report | None = field(default=None)

    @property
    def width(self) -> int:
        return self.network.width

    @property
    def height(self) -> int:
        return self.network.height

    @property
    def curves(self) -> tuple[Curve, ...]:
        """The boundary curves of the network."""
        return self.network.curves

    @property
    def warnings(self) -> tuple[str, ...]:
        """All that a caller should know: about the regions first, then about the result."""
        return (*self.region_warnings, *self.result_warnings)

    @cached_property
    def foundation(self) -> Foundation:
        return lay_foundation(self.network, self.hard, self.control_points)

    @cached_property
    def canvas(self) -> Canvas:
        """The canonical mesh."""
        return lay_canvas(self.foundation, self.points)

    @cached_property
    def colors(self) -> Floats:
        """All unknown colours `(b + n, 3)`, as they are drawn."""
        return drawn_colors(np.concatenate([self.boundary_colors, self.point_colors]))

    @cached_property
    def foldovers(self) -> int:
        """Triangles of the canonical mesh that the patches turn over."""
        return len(self.canvas.foldovers())

    @cached_property
    def neighborhoods(self) -> Neighborhoods:
        """What its file predicts the colours of interior control points from."""
        from gcvec.codec.neighborhoods import neighborhoods

        return neighborhoods(self.points, self.patch_of_points, self.height, self.width)

    @cached_property
    def strides(self) -> Strides:
        """How coarsely its file stores each colour."""
        from gcvec.codec.strides import strides

        return strides(self.canvas)

    @property
    def patch_of_points(self) -> Ints:
        """`(n,)` patch of every interior control point."""
        return self.canvas.patch_of_points()

    def gouraud(self, scale: float = 1.0) -> tuple[Floats, Ints, Floats, Ints]:
        """The picture as triangles for output at `scale`.

        Returns vertices `(v, 2)` in pixels of the picture, triangles `(t, 3)`, colours `(k, 3)` and the
        colour `(t, 3)` of each triangle's corners; vertices on hard edges have several colours.
        """
        if scale == 1:
            drawing, operator, corner_color = self.canvas.unit
        else:
            drawing = self.canvas.drawing(FLATNESS / scale)
            operator, corner_color = self.canvas.operator(drawing)
        return drawing.image, drawing.triangles, operator @ self.colors, corner_color

    def render(self, scale: float = 1.0, raw: bool = False) -> NDArray[np.uint8]:
        """The picture `(round(height * scale), round(width * scale), 3) uint8`, sRGB.

        Every pixel is the average over its square; with `raw` it is the colour at its centre. Raises
        `InputError` ("bad-option") for a scale that is not above 0, or makes too large a picture.
        """
        if not (scale > 0 and scale * scale * self.width * self.height < MOST_DRAWN):
            raise InputError(f"cannot draw at scale {scale:g}", code="bad-option", pointer="scale")
        height, width = (max(1, round(n * scale)) for n in (self.height, self.width))
        vertices, triangles, colors, corner_color = self.gouraud(scale)
        paint = raster.sample if raw else raster.paint
        vertices = vertices * [width / self.width, height / self.height]
        picture = np.empty((height, width, 3), np.uint8)
        rows = max(BAND // width, 1)
        for first in range(0, height, rows):
            band = picture[first : first + rows]
            drawn = paint(vertices - [0, first], triangles, colors, corner_color, width, len(band))
            band[:] = to_8_bit(drawn)
        return picture

    @cached_property
    def picture(self) -> NDArray[np.uint8]:
        """The picture at its own size, as `render` gives it; made once."""
        return self.render()

    @cached_property
    def _file(self) -> bytes:
        from gcvec.codec.file import encode

        return encode(self)

    def to_bytes(self) -> bytes:
        """The `.gcv` file."""
        return self._file

    def knowing(
        self, canvas: Canvas, file: bytes | None = None, picture: NDArray[np.uint8] | None = None
    ) -> VectorImage:
        """This image with its canonical mesh, file and picture already known: they are not made again."""
        image = replace(self)
        known = image.__dict__  # where cached properties are kept
        known.update(foundation=canvas.foundation, canvas=canvas)
        if file is not None:
            known["_file"] = file
        if picture is not None:
            known["picture"] = picture
        return image

    def in_steps(self, steps: Quantization) -> VectorImage:
        """This image, to be stored in other steps."""
        image = replace(self, quantization=steps).knowing(self.canvas)
        image.__dict__.update(neighborhoods=self.neighborhoods, strides=self.strides)
        return image

    @classmethod
    def from_bytes(cls, data: bytes) -> VectorImage:
        """Read a `.gcv` file; `InputError` when it is not a whole one."""
        from gcvec.codec.file import decode

        return decode(data)

    def save(self, path: str | Path) -> None:
        Path(path).write_bytes(self.to_bytes())

    @classmethod
    def load(cls, path: str | Path) -> VectorImage:
        return cls.from_bytes(Path(path).read_bytes())

    def description(self) -> dict[str, Any]:
        """The complete description as JSON-ready data, format "gcvec/1"."""
        from gcvec.export.description import describe

        return describe(self)


def drawn_colors(colors: Floats) -> Floats:
    """Colours as they are drawn: at most `OVERSHOOT` beyond [0, 1]."""
    return np.asarray(np.clip(colors, -OVERSHOOT, 1 + OVERSHOOT))


def to_8_bit(picture: Floats) -> NDArray[np.uint8]:
    """Colours in [0, 1] as bytes, rounded to nearest."""
    return (np.clip(picture, 0, 1) * 255 + 0.5).astype(np.uint8)
