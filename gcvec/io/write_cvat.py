"""Regions -> CVAT for images 1.1, to be corrected in CVAT and read again."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from gcvec.io.limits import DEFAULT_LIMITS, Limits
from gcvec.io.long_outlines import checked, to_be_masked
from gcvec.io.outlines import Outline, outlines
from gcvec.io.rle import runs_of
from gcvec.plain_text import plain_text

if TYPE_CHECKING:
    from gcvec.regions.partition import Partition


def write_cvat_xml(partition: Partition, image_name: str, limits: Limits = DEFAULT_LIMITS) -> bytes:
    """One polygon a region, or a mask where the polygon would be beyond `limits`.

    CVAT's polygons have no holes, so a region that lies inside others has a higher `z_order`. Read back and
    partitioned, the document gives the same label map, provided no region is a sliver.

    Raises `InputError` ("annotations-too-large") for what could not be read back.
    """
    height, width = partition.labels.shape
    document = ElementTree.Element("annotations")
    ElementTree.SubElement(document, "version").text = "1.1"
    size = {"width": str(width), "height": str(height)}
    image = ElementTree.SubElement(document, "image", {"id": "0", "name": plain_text(image_name), **size})
    found = outlines(partition.labels)
    masked = to_be_masked(found, limits)
    for region, (name, outline) in enumerate(zip(partition.names, found, strict=True)):
        place = _mask(partition.labels, region, outline) if masked[region] else _polygon(outline)
        about = {"label": plain_text(name), "source": "auto", "occluded": "0"}
        tag = "mask" if masked[region] else "polygon"
        ElementTree.SubElement(image, tag, {**about, **place, "z_order": str(outline.depth)})
    ElementTree.indent(document)
    written: bytes = ElementTree.tostring(document, encoding="utf-8", xml_declaration=True)
    return checked(written + b"\n", limits)


def _polygon(outline: Outline) -> dict[str, str]:
    return {"points": ";".join(f"{x:.1f},{y:.1f}" for x, y in outline.ring.tolist())}


def _mask(labels: NDArray[np.int32], region: int, outline: Outline) -> dict[str, str]:
    """The region's own pixels, row by row, in the box that holds them."""
    left, top, right, bottom = outline.box
    runs = runs_of((labels[top:bottom, left:right] == region).ravel())
    box = {"left": left, "top": top, "width": right - left, "height": bottom - top}
    return {"rle": ", ".join(map(str, runs)), **{name: str(value) for name, value in box.items()}}
