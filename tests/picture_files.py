"""Pictures as files."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageCms


def encoded(image: Image.Image, kind: str = "PNG", **options: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def pixels(data: bytes | Path) -> np.ndarray:
    with Image.open(io.BytesIO(data) if isinstance(data, bytes) else data) as picture:
        return np.asarray(picture.convert("RGB")).astype(float)


def png_with_header(width: int, height: int) -> bytes:
    """A PNG that states a size and holds no pixels."""
    return _png((width, height), 8, 2, b"", b"")


def png(size: tuple[int, int], bits: int, kind: int, rows: list[bytes], key: bytes = b"") -> bytes:
    """A PNG of that many bits a sample and colour type; the key is its transparent colour."""
    return _png(
        size, bits, kind, _chunk(b"tRNS", key) if key else b"", zlib.compress(b"\0" + b"\0".join(rows))
    )


def _png(size: tuple[int, int], bits: int, kind: int, before: bytes, body: bytes) -> bytes:
    header = _chunk(b"IHDR", struct.pack(">IIBBBBB", *size, bits, kind, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + before + _chunk(b"IDAT", body) + _chunk(b"IEND", b"")


def _chunk(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def swapped_profile() -> bytes:
    """sRGB with the red and the green primary exchanged: a profile nobody can overlook."""
    profile = bytearray(ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes())
    red, green = profile.index(b"rXYZ"), profile.index(b"gXYZ")
    profile[red : red + 4], profile[green : green + 4] = b"gXYZ", b"rXYZ"
    return bytes(profile)
