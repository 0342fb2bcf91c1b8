"""GLB: a flat mesh with vertex colours (glTF 2.0), one primitive, unlit.

glTF interpolates colours in linear light and this picture in sRGB: edges along which that would show are cut.
"""

from __future__ import annotations

import json
import struct

import numpy as np
from numpy.typing import NDArray

from gcvec.export.triangles import Triangles, drawn_triangles
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

TOLERANCE = 1 / 255
"""Largest error, in sRGB, of interpolating along an edge in linear light."""

FLOAT, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963


def glb(image: VectorImage) -> bytes:
    """A GLB file of the picture in the plane z = 0, y up, with its middle at the origin.

    Its longer side has length 1.

    The positions in the file are pixels, which the node scales.
    """
    triangles = subdivided(drawn_triangles(image))
    positions = np.zeros((len(triangles.positions), 3), np.float32)
    positions[:, :2] = triangles.positions * (1, -1) + (0, image.height)
    colors = np.full((len(positions), 4), 65535, np.uint16)
    colors[:, :3] = np.rint(linear_light(triangles.colors) * 65535)
    # Turning y over turns the triangles over too.
    short = len(positions) < 65536
    indices = np.ascontiguousarray(triangles.corners[:, ::-1], np.uint16 if short else np.uint32)

    parts = [positions.tobytes(), colors.tobytes(), indices.tobytes()]
    scale = 1 / max(image.width, image.height)
    document = {
        "asset": {"version": "2.0", "generator": "gcvec"},
        "extensionsUsed": ["KHR_materials_unlit"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {
                "mesh": 0,
                "scale": [scale, scale, scale],
                "translation": [-image.width * scale / 2, -image.height * scale / 2, 0],
            }
        ],
        "meshes": [
            {"primitives": [{"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}]}
        ],
        "materials": [{"doubleSided": True, "extensions": {"KHR_materials_unlit": {}}}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": FLOAT,
                "count": len(positions),
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            },
            {
                "bufferView": 1,
                "componentType": UNSIGNED_SHORT,
                "normalized": True,
                "count": len(colors),
                "type": "VEC4",
            },
            {
                "bufferView": 2,
                "componentType": UNSIGNED_SHORT if short else UNSIGNED_INT,
                "count": indices.size,
                "type": "SCALAR",
            },
        ],
        "bufferViews": _views(parts),
        "buffers": [{"byteLength": sum(map(len, parts))}],
    }
    return _file(json.dumps(document, separators=(",", ":")).encode(), b"".join(parts))


def _views(parts: list[bytes]) -> list[dict[str, int]]:
    starts = np.cumsum([0, *map(len, parts)]).tolist()
    targets = (VERTICES, VERTICES, INDICES)
    return [
        {"buffer": 0, "byteOffset": start, "byteLength": len(part), "target": target}
        for start, part, target in zip(starts, parts, targets, strict=False)
    ]


def _file(document: bytes, data: bytes) -> bytes:
    document += b" " * (-len(document) % 4)
    data += b"\0" * (-len(data) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(document) + 8 + len(data))
    chunks = ((b"JSON", document), (b"BIN\0", data))
    return header + b"".join(struct.pack("<I4s", len(chunk), kind) + chunk for kind, chunk in chunks)


def linear_light(srgb: Floats) -> Floats:
    """sRGB in [0, 1] as linear light (IEC 61966-2-1)."""
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def srgb(light: Floats) -> Floats:
    """Linear light in [0, 1] as sRGB."""
    return np.where(light <= 0.0031308, light * 12.92, 1.055 * light ** (1 / 2.4) - 0.055)


def subdivided(triangles: Triangles, tolerance: float = TOLERANCE) -> Triangles:
    """The same picture with edges cut until interpolating along them in linear light errs by at most
    `tolerance`.

    An edge that two triangles share is cut for both, also where their colours differ, so that no crack opens.
    """
    while True:
        edges = np.stack([triangles.corners, np.roll(triangles.corners, -1, axis=1)], axis=2)
        places = np.sort(triangles.places[edges].reshape(-1, 2), axis=1)
        _, number = np.unique(places, axis=0, return_inverse=True)
        number = number.reshape(-1)
        cut = np.zeros(number.max() + 1, bool)
        cut[number[_error(triangles.colors[edges].reshape(-1, 2, 3)) > tolerance]] = True
        if not cut.any():
            return triangles
        triangles = _cut(triangles, edges.reshape(-1, 2), number, cut)


def _error(ends: Floats) -> Floats:
    """`(n,)` largest error along edges `(n, 2, 3)`, measured at seven points."""
    along = np.arange(1, 8)[:, None, None] / 8
    a, b = ends[:, 0], ends[:, 1]
    blended = srgb((1 - along) * linear_light(a) + along * linear_light(b))
    return np.asarray(np.abs(blended - ((1 - along) * a + along * b)).max(axis=(0, 2)))


def _cut(triangles: Triangles, edges: Ints, number: Ints, cut: NDArray[np.bool_]) -> Triangles:
    """Halve the edges `(3 t, 2)` whose geometric `number` is `cut`."""
    halved = np.flatnonzero(cut[number])
    ends, which = np.unique(np.sort(edges[halved], axis=1), axis=0, return_inverse=True)
    middle = np.full(len(edges), -1, np.int64)
    middle[halved] = len(triangles.positions) + which.reshape(-1)
    place = np.zeros(len(ends), np.int64)
    place[which.reshape(-1)] = triangles.places.max() + 1 + number[halved]
    return Triangles(
        np.concatenate([triangles.positions, triangles.positions[ends].mean(axis=1)]),
        np.concatenate([triangles.colors, triangles.colors[ends].mean(axis=1)]),
        _split(triangles.corners, middle.reshape(-1, 3)),
        np.concatenate([triangles.places, place]),
    )


def _split(corners: Ints, middle: Ints) -> Ints:
    """Triangles `(t, 3)` with the `middle` of their edges (-1: not halved), cut into two, three or four."""
    count = (middle >= 0).sum(axis=1)
    # Turn each so that its first edge is halved and, of two, the second too.
    first = np.where(count == 1, (middle >= 0).argmax(axis=1), ((middle < 0).argmax(axis=1) + 1) % 3)
    turn = (np.where(count == 3, 0, first)[:, None] + np.arange(3)) % 3
    (a, b, c), (ab, bc, ca) = (np.take_along_axis(x, turn, axis=1).T for x in (corners, middle))
    pieces = [corners[count == 0]]
    for n, parts in (
        (1, ((a, ab, c), (ab, b, c))),
        (2, ((a, ab, c), (ab, b, bc), (ab, bc, c))),
        (3, ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))),
    ):
        pieces += [np.stack(part, axis=1)[count == n] for part in parts]
    return np.concatenate(pieces)
