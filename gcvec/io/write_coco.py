"""Regions -> COCO 1.0 instances."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from gcvec.io.outlines import Outline, outlines

if TYPE_CHECKING:
    from gcvec.partition import Partition


def write_coco(partition: Partition, image_name: str) -> bytes:
    """One annotation with one polygon a region, along pixel edges.

    The polygons have no holes; annotations come in painter's order, so a region that lies inside another
    comes later. Read back and partitioned, the document gives the same label map, provided no region is a
    sliver.
    """
    height, width = partition.labels.shape
    categories = {name: number for number, name in enumerate(dict.fromkeys(partition.names), start=1)}
    areas = np.bincount(partition.labels.ravel()).tolist()
    regions = zip(partition.names, outlines(partition.labels), areas, strict=True)
    document = {
        "images": [{"id": 1, "file_name": image_name, "width": width, "height": height}],
        "categories": [{"id": number, "name": name} for name, number in categories.items()],
        "annotations": [
            _annotation(number, categories[name], outline, area)
            for number, (name, outline, area) in enumerate(regions, start=1)
        ],
    }
    return json.dumps(document, separators=(",", ":")).encode() + b"\n"


def _annotation(number: int, category: int, outline: Outline, area: int) -> dict[str, Any]:
    left, top = outline.ring.min(axis=0).tolist()
    right, bottom = outline.ring.max(axis=0).tolist()
    return {
        "id": number,
        "image_id": 1,
        "category_id": category,
        "segmentation": [outline.ring.ravel().tolist()],
        "area": area,
        "bbox": [left, top, right - left, bottom - top],
        "iscrowd": 0,
    }
