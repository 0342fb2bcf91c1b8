"""PDF: one page, painted by one shading of free-form Gouraud triangles (ISO 32000-1, 8.7.4.5.5).

There are no clip paths, along which readers would leave hairlines. Most triangles share two vertices with the
one before and store only the third, as its difference from the vertex before.
"""

from __future__ import annotations

import zlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.export.triangles import Triangles, drawn_triangles
from gcvec.vector_image import VectorImage

Bytes = NDArray[np.uint8]

LARGEST_PAGE = 14400
"""The longest side of a page, points, that every reader accepts; a pixel is a point up to there."""

STEP = 1 / 32.1
"""Coordinates are multiples of this, pixels: an odd number, because PDFium leaves a gap beside a vertex that
lies exactly on one of its scan lines."""

BLEED = 0.06
"""How far vertices on the picture's frame reach beyond the page, pixels."""


def pdf(image: VectorImage) -> bytes:
    """A PDF file of the picture, one point a pixel."""
    width, height = image.width, image.height
    point = min(1.0, LARGEST_PAGE / max(width, height))
    triangles = drawn_triangles(image)
    positions = _bleeding(triangles.positions, width, height)
    least, most = float(positions.min()), float(positions.max())
    coordinate_bytes = 2 if (most - least) / STEP < 2**16 else 3
    records = _records(replace(triangles, positions=positions - least), coordinate_bytes)
    decode = f"{least:.10g} {(2 ** (8 * coordinate_bytes) - 1) * STEP + least:.10g}"
    shading = (
        f"/ShadingType 4 /ColorSpace /DeviceRGB /BitsPerFlag 8 /BitsPerComponent 8"
        f" /BitsPerCoordinate {8 * coordinate_bytes} /Decode [{decode} {decode} 0 1 0 1 0 1]"
        f" /Filter /FlateDecode /DecodeParms << /Predictor 12 /Columns {records.shape[1]} >>"
    )
    page = (
        f"/Type /Page /Parent 2 0 R /MediaBox [0 0 {width * point:.8g} {height * point:.8g}]"
        " /Resources << /Shading << /S 4 0 R >> >> /Contents 5 0 R"
    )
    paint = f"{point:.8g} 0 0 {-point:.8g} 0 {height * point:.8g} cm /S sh"
    return _file(
        [
            b"<< /Type /Catalog /Pages 2 0 R >>",
            b"<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
            f"<< {page} >>".encode(),
            _stream(shading, zlib.compress(_differences(records), 9)),
            _stream("", paint.encode()),
            b"<< /Producer (gcvec) >>",
        ]
    )


def _bleeding(positions: NDArray[np.float64], width: int, height: int) -> NDArray[np.float64]:
    """Positions `(v, 2)`, those on the frame moved beyond it; an edit may have moved others further."""
    size = np.array([width, height])
    beyond = np.where(positions >= size, np.maximum(positions, size + BLEED), positions)
    return np.where(positions <= 0, np.minimum(positions, -BLEED), beyond)


def _records(triangles: Triangles, coordinate_bytes: int) -> Bytes:
    """`(n, bytes)`: flag, coordinates and colour of every vertex, in the order of the shading.

    Positions must not be below 0.
    """
    flags, order = _chain(triangles.corners)
    position = np.rint(triangles.positions / STEP).astype(">u4")
    color = np.rint(triangles.colors * 255).astype(np.uint8)
    coordinates = (
        position.view(np.uint8).reshape(-1, 2, 4)[:, :, 4 - coordinate_bytes :].reshape(len(color), -1)
    )
    return np.concatenate([flags[:, None], coordinates[order], color[order]], axis=1)


def _chain(corners: NDArray[np.int64]) -> tuple[Bytes, NDArray[np.int64]]:
    """Edge flags and vertices of all triangles, each attached to the one before if an edge is shared.

    Flag 0 starts a triangle anew, with three records; 1 and 2 keep its last vertex and its second or first.
    """
    triangles = corners.tolist()
    beside: dict[tuple[int, int], list[int]] = {}
    for t, (a, b, c) in enumerate(triangles):
        for edge in ((a, b), (b, c), (c, a)):
            beside.setdefault((min(edge), max(edge)), []).append(t)
    drawn = bytearray(len(triangles))

    def across(p: int, q: int) -> int | None:
        return next((t for t in beside[min(p, q), max(p, q)] if not drawn[t]), None)

    flags, order = bytearray(), []
    for t, triangle in enumerate(triangles):
        if drawn[t]:
            continue
        drawn[t] = 1
        first, second, third = triangle
        if across(second, third) is None and across(first, third) is None:
            first, second, third = second, third, first
        flags += b"\0\0\0"
        order += [first, second, third]
        while True:
            flag, kept = 1, second
            following = across(second, third)
            if following is None:
                flag, kept = 2, first
                following = across(first, third)
            if following is None:
                break
            drawn[following] = 1
            new = sum(triangles[following]) - kept - third
            first, second, third = kept, third, new
            flags.append(flag)
            order.append(new)
    return np.frombuffer(bytes(flags), np.uint8), np.array(order, np.int64)


def _differences(records: Bytes) -> bytes:
    """Rows as differences from the row above, each after its filter type: PNG's filter 2, "up"."""
    above = np.concatenate([np.zeros_like(records[:1]), records[:-1]])
    rows: Bytes = np.insert(records - above, 0, 2, axis=1)
    return rows.tobytes()


def _stream(entries: str, data: bytes) -> bytes:
    return b"<< %s /Length %d >>\nstream\n%s\nendstream" % (entries.encode(), len(data), data)


def _file(objects: list[bytes]) -> bytes:
    """The objects, numbered from 1: the root first, the document information last."""
    file = bytearray(b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n")
    table = [b"0000000000 65535 f \n"]
    for number, content in enumerate(objects, 1):
        table.append(b"%010d 00000 n \n" % len(file))
        file += b"%d 0 obj\n%s\nendobj\n" % (number, content)
    start = len(file)
    file += b"xref\n0 %d\n%s" % (len(table), b"".join(table))
    file += b"trailer\n<< /Size %d /Root 1 0 R /Info %d 0 R >>\n" % (len(table), len(objects))
    return bytes(file + b"startxref\n%d\n%%%%EOF\n" % start)
