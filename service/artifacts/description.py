"""The patch description "gcvec/1" as a schema: for the interface description, and for clients' validators."""

from __future__ import annotations

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

Point = Annotated[list[float], Field(min_length=2, max_length=2, description="x, y in pixels")]
Color = Annotated[
    list[float],
    Field(
        min_length=3,
        max_length=3,
        description="red, green, blue: sRGB, nominally 0 to 1; to be clipped once interpolated",
    ),
]
Id = Annotated[int, Field(ge=0)]

LARGEST_NUMBER: Final = 2**31
"""Of patches, curves, points and revisions, where a client names them."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid")


class Size(_Model):
    """Pixels."""

    width: int = Field(gt=0)
    height: int = Field(gt=0)


class SideColors(_Model):
    """One set of colour control points a side of a hard curve; the outside of the picture has none."""

    left: list[Color] | None = None
    right: list[Color] | None = None


class BoundaryCurve(_Model):
    """A cubic B-spline with uniform knots, clamped or closed, between two patches."""

    id: Id
    degree: Literal[3]
    closed: bool
    segments: int = Field(gt=0)
    control_points: list[Point]
    hard: bool = Field(description="whether the colours differ from one side to the other")
    colors: list[Color] | SideColors = Field(description="colour control points, like `control_points`")
    left: Id | None = Field(description="the patch at the left; null: the outside")
    right: Id | None = Field(description="the patch at the right; null: the outside")


class Span(_Model):
    """A piece of a boundary curve, from one parameter to another; backwards where `from` is the larger."""

    model_config = ConfigDict(extra="forbid", validate_by_name=True)

    curve: Id
    start: float = Field(alias="from")
    to: float


class InteriorPoint(_Model):
    """An interior control point: where it is in the parameter polygon and in the picture, and its colour."""

    domain: Point
    image: Point
    color: Color


class PatchMetrics(_Model):
    """What refinement spent on the patch, and how close it came."""

    points: int
    iterations: int
    mse: float


class Patch(_Model):
    """A generalized Coons patch."""

    id: Id
    label: str
    loops: list[list[Span]] = Field(description="the outer border first, then the holes")
    domain: list[list[Point]] = Field(description="the parameter polygon, a vertex a span")
    points: list[InteriorPoint]
    metrics: PatchMetrics | None = None


class Mesh(_Model):
    """The drawing as triangles with a colour a corner, interpolated in sRGB."""

    positions: list[Point]
    colors: list[Color]
    triangles: list[Annotated[list[int], Field(min_length=3, max_length=3)]]


class Metrics(_Model):
    """Counts and, where the photo was at hand, errors on the 0-255 scale."""

    patches: int
    points: int
    foldovers: int
    mse: float | None = None
    mse_raw: float | None = None
    mae: float | None = None
    psnr: float | None = None
    ssim: float | None = None
    bytes: int | None = None
    strategy: str | None = None


class Description(_Model):
    """A vector image, complete: it can be drawn from this alone.

    Positions are pixels from the top-left corner of the top-left pixel, y down.
    """

    format: Literal["gcvec/1"]
    image: Size
    curves: list[BoundaryCurve]
    patches: list[Patch]
    mesh: Mesh
    metrics: Metrics
    seconds: dict[str, float]
    warnings: list[str]
