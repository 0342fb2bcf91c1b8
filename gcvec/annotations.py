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
    """The shapes of one image, in document order, with the image's sides as the annotation file states them,
    0 for one that it does not state."""

    shapes: tuple[Shape, ...]
    width: int = 0
    height: int = 0
    warnings: tuple[str, ...] = ()


def check_size(annotations: Annotations, width: int, height: int) -> None:
    """Raise `InputError` when the annotations were drawn on a picture of another size, as far as they state
    it, or hold no region."""
    if annotations.width not in (0, width) or annotations.height not in (0, height):
        raise InputError(
            f"the annotations are for a picture {_stated_size(annotations)}, this one has {width} x {height}",
            code="size-mismatch",
        )
    if not annotations.shapes:
        why = f" ({'; '.join(annotations.warnings)})" if annotations.warnings else ""
        raise InputError(f"the annotations hold no region for this picture{why}", code="no-usable-polygon")


def _stated_size(annotations: Annotations) -> str:
    """The size stated, in words; one side where the other is not."""
    if not annotations.width:
        return f"{annotations.height} pixels high"
    if not annotations.height:
        return f"{annotations.width} pixels wide"
    return f"of {annotations.width} x {annotations.height} pixels"
