"""A small picture and its annotations, as clients upload them."""

from __future__ import annotations

import io

from PIL import Image


def png(width: int = 30, height: int = 20) -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (width, height), (200, 30, 30)).save(buffer, "PNG")
    return buffer.getvalue()


def cvat(
    name: str = "a.png", width: int = 30, height: int = 20, points: str = "1,1;20,1;20,15;1,15"
) -> bytes:
    polygon = f'<polygon label="x" source="manual" occluded="0" points="{points}" z_order="0"></polygon>'
    image = f'<image id="0" name="{name}" width="{width}" height="{height}">{polygon}</image>'
    return f'<?xml version="1.0"?><annotations><version>1.1</version>{image}</annotations>'.encode()
