"""Which regions are written as masks, because a reader would refuse their outlines as too long."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gcvec.errors import InputError
from gcvec.io.limits import Limits
from gcvec.io.outlines import Outline


def to_be_masked(found: Sequence[Outline], limits: Limits) -> NDArray[np.bool_]:
    """`(n,) bool`: those whose outline has too many vertices, and then as many as it takes for the rest to
    have no more together than all polygons may.

    Raises `InputError` ("annotations-too-large") for too many regions, or for masks of too many pixels.
    """
    if len(found) > limits.max_polygons:
        raise _too_large(f"{len(found)} regions, at most {limits.max_polygons} can be read again")
    vertices = np.array([len(outline.ring) for outline in found])
    boxes = np.array([outline.box for outline in found])
    pixels = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    masked: NDArray[np.bool_] = vertices > limits.max_vertices_per_polygon
    left = vertices[~masked].sum()
    for region in np.argsort(pixels / vertices, kind="stable"):
        if left <= limits.max_vertices:
            break
        left -= 0 if masked[region] else vertices[region]
        masked[region] = True
    if pixels[masked].sum() > limits.mask_pixels:
        raise _too_large("outlines of too many vertices, and too large to be written as masks")
    return masked


def checked(document: bytes, limits: Limits) -> bytes:
    """The document, unless it is longer than what can be read again: then an `InputError`."""
    if len(document) > limits.annotation_bytes:
        raise _too_large(f"{len(document)} bytes, at most {limits.annotation_bytes} can be read again")
    return document


def _too_large(why: str) -> InputError:
    return InputError(f"too many annotations: {why}; ask for fewer regions", code="annotations-too-large")
