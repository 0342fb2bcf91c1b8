"""GLB: a flat mesh with vertex colours (glTF 2.0), one primitive, unlit."""

from __future__ import annotations

import json
import struct
from itertools import accumulate

import numpy as np

from gcvec.export.linear_light import linear_light, subdivided
from gcvec.export.triangles import drawn_triangles
from gcvec.vector_image import VectorImage

FLOAT, UNSIGNED_SHORT, UNSIGNED_INT = 5126, 5123, 5125
VERTICES, INDICES = 34962, 34963


def glb(image: VectorImage) -> bytes:
    """A GLB file of the picture in the plane z = 0, y up, its middle at the origin.

    The positions in the file are pixels; the node scales them so that the longer side has length 1.
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
    starts = accumulate(map(len, parts[:-1]), initial=0)
    targets = (VERTICES, VERTICES, INDICES)
    return [
        {"buffer": 0, "byteOffset": start, "byteLength": len(part), "target": target}
        for start, part, target in zip(starts, parts, targets, strict=True)
    ]


def _file(document: bytes, data: bytes) -> bytes:
    document += b" " * (-len(document) % 4)
    data += b"\0" * (-len(data) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(document) + 8 + len(data))
    chunks = ((b"JSON", document), (b"BIN\0", data))
    return header + b"".join(struct.pack("<I4s", len(chunk), kind) + chunk for kind, chunk in chunks)
