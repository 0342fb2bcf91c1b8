"""Regions -> COCO 1.0 instances."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gcvec.io.limits import DEFAULT_LIMITS, Limits
from gcvec.io.long_outlines import checked, to_be_masked
from gcvec.io.outlines import Outline, outlines
from gcvec.io.rle import runs_of
from gcvec.plain_text import plain_text

if TYPE_CHECKING:
    from gcvec.regions.partition import Partition


def write_coco(partition: Partition, image_name: str, limits: Limits = DEFAULT_LIMITS) -> bytes:
    """One annotation with one polygon a region, or with a run-length mask where the polygon would be beyond
    `limits`.

    The polygons have no holes; annotations come in painter's order, so a region that lies inside another
    comes later. Read back and partitioned, the document gives the same label map, provided no region is a
    sliver. Raises `InputError` ("annotations-too-large") for what could not be read back.
    """
    height, width = partition.labels.shape
    categories = {name: number for number, name in enumerate(dict.fromkeys(partition.names), start=1)}
    found = outlines(partition.labels)
    masked = to_be_masked(found, limits)
    areas = np.bincount(partition.labels.ravel()).tolist()
    document = {
        "images": [{"id": 1, "file_name": plain_text(image_name), "width": width, "height": height}],
        "categories": [{"id": number, "name": name} for name, number in categories.items()],
        "annotations": [
            {
                "id": region + 1,
                "image_id": 1,
                "category_id": categories[partition.names[region]],
                "segmentation": _mask(partition.labels, region) if masked[region] else _polygon(outline),
                "area": areas[region],
                "bbox": _box(outline),
                "iscrowd": int(masked[region]),  # how COCO marks plain run lengths
            }
            for region, outline in enumerate(found)
        ],
    }
    return checked(json.dumps(document, separators=(",", ":")).encode() + b"\n", limits)


def _polygon(outline: Outline) -> list[list[float]]:
    return [outline.ring.ravel().tolist()]


def _mask(labels: NDArray[np.int32], region: int) -> dict[str, Any]:
    """The region's own pixels, column by column."""
    return {"size": list(labels.shape), "counts": runs_of((labels == region).ravel(order="F"))}


def _box(outline: Outline) -> list[int]:
    left, top, right, bottom = outline.box
    return [left, top, right - left, bottom - top]
