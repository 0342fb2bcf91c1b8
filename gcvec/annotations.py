"""Region annotations as the readers deliver them: shapes over an image, painted in order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.errors import InputError


@dataclass(frozen=True)
class Shape:
    """One annotated region.

    Either `rings` (each `(n, 2) float64`, pixels, origin at the top-left corner of the top-left pixel;
    together they cover the union of their interiors) or `mask` (`(h, w) bool`, with its top-left pixel at
    `offset = (x, y)`). `pointer` says where in the annotation file the shape stands, for warnings.
    """

    label: str
    rings: tuple[NDArray[np.float64], ...] = ()
    mask: NDArray[np.bool_] | None = None
    offset: tuple[int, int] = (0, 0)
    z_order: int = 0
    pointer: str = ""


@dataclass(frozen=True)
class Annotations:
    """The shapes of one image, in document order, with the image size the annotation file states (0, 0 if
    none)."""

    shapes: tuple[Shape, ...]
    width: int = 0
    height: int = 0
    warnings: tuple[str, ...] = ()


def check_size(annotations: Annotations, width: int, height: int) -> None:
    """Raise `InputError` when the annotations were drawn on a picture of another size, or hold no region."""
    stated = annotations.width, annotations.height
    if stated not in ((0, 0), (width, height)):
        raise InputError(
            f"the annotations are for a picture of {stated[0]} x {stated[1]} pixels, "
            f"this one has {width} x {height}",
            code="size-mismatch",
        )
    if not annotations.shapes:
        why = f" ({'; '.join(annotations.warnings)})" if annotations.warnings else ""
        raise InputError(f"the annotations hold no region for this picture{why}", code="no-usable-polygon")
