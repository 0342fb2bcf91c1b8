"""Regions -> CVAT for images 1.1, to be corrected in CVAT and read again."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from gcvec.io.outlines import outlines

if TYPE_CHECKING:
    from gcvec.partition import Partition

_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def write_cvat_xml(partition: Partition, image_name: str) -> bytes:
    """One polygon a region along pixel edges.

    CVAT's polygons have no holes, so a region that lies inside others has a higher `z_order`. Read back and
    partitioned, the document gives the same label map, provided no region is a sliver.
    """
    height, width = partition.labels.shape
    document = ElementTree.Element("annotations")
    ElementTree.SubElement(document, "version").text = "1.1"
    size = {"width": str(width), "height": str(height)}
    image = ElementTree.SubElement(document, "image", {"id": "0", "name": _text(image_name), **size})
    for name, outline in zip(partition.names, outlines(partition.labels), strict=True):
        polygon = {"label": _text(name), "source": "auto", "occluded": "0", "points": _points(outline.ring)}
        ElementTree.SubElement(image, "polygon", {**polygon, "z_order": str(outline.depth)})
    ElementTree.indent(document)
    written: bytes = ElementTree.tostring(document, encoding="utf-8", xml_declaration=True)
    return written + b"\n"


def _points(ring: NDArray[np.int64]) -> str:
    return ";".join(f"{x}.0,{y}.0" for x, y in ring.tolist())


def _text(text: str) -> str:
    """The text without the characters no XML document can hold."""
    return _NOT_XML.sub("\ufffd", text)
