"""How much input is accepted, and the running account kept while annotations are read."""

from __future__ import annotations

from dataclasses import dataclass

from gcvec.errors import InputError


@dataclass(frozen=True)
class Limits:
    """Bounds on one picture and its annotations.

    `annotation_bytes` bounds an annotation document, also after it was inflated from a zip archive;
    `mask_pixels` bounds the pixels of all masks of an image together, each counted as its bounding box.
    """

    max_pixels: int = 64_000_000
    max_side: int = 16_384
    max_polygons: int = 2_000
    max_vertices_per_polygon: int = 20_000
    max_vertices: int = 200_000
    annotation_bytes: int = 25_000_000
    mask_pixels: int = 128_000_000


DEFAULT_LIMITS = Limits()

_BYTES_AN_IMAGE = 100
"""About what an image takes at least in a real annotation file: no more are looked through than would fit."""


def require_few_images(count: int, limits: Limits) -> None:
    """Raise `InputError` where annotations list more images than real ones of the largest size would."""
    if count > (most := limits.annotation_bytes // _BYTES_AN_IMAGE):
        raise InputError(f"too many annotations: more than {most} images", code="annotations-too-large")


class Account:
    """Counts what the shapes of one image cost and raises `InputError` before a limit is passed."""

    def __init__(self, limits: Limits) -> None:
        self._limits = limits
        self._shapes = 0
        self._vertices = 0
        self._mask_pixels = 0

    def add_shape(self, pointer: str) -> None:
        self._shapes += 1
        if self._shapes > self._limits.max_polygons:
            raise _too_large(f"more than {self._limits.max_polygons} regions", pointer)

    def add_vertices(self, count: int, pointer: str) -> None:
        if count > self._limits.max_vertices_per_polygon:
            allowed = self._limits.max_vertices_per_polygon
            raise _too_large(f"{pointer} has {count} vertices, at most {allowed} are accepted", pointer)
        self._vertices += count
        if self._vertices > self._limits.max_vertices:
            raise _too_large(f"more than {self._limits.max_vertices} vertices in all", pointer)

    def add_mask(self, pixels: int, pointer: str) -> None:
        self._mask_pixels += pixels
        if self._mask_pixels > self._limits.mask_pixels:
            raise _too_large(f"masks of more than {self._limits.mask_pixels} pixels in all", pointer)


def _too_large(message: str, pointer: str) -> InputError:
    return InputError(f"too many annotations: {message}", code="annotations-too-large", pointer=pointer)
