"""Checked numbers and rings, shared by the annotation readers."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gcvec.errors import InputError
from gcvec.io.rle import Counts

Ring = NDArray[np.float64]

_FARTHEST = 1e7
"""Coordinates are held within this: so far from the picture it makes no difference where a vertex lies."""


def broken(message: str, pointer: str) -> InputError:
    return InputError(f"{pointer}: {message}", code="broken-annotations", pointer=pointer)


def is_plain(text: str) -> bool:
    """Whether text is written as other programs write numbers: Python takes digits of every script, and 1_0
    for 10."""
    return text.isascii() and "_" not in text


def ring_from(values: Sequence[object], pointer: str) -> Ring:
    """A ring `(n, 2)` from x, y, x, y …, held within `_FARTHEST`; raises `InputError` on anything but pairs
    of finite numbers."""
    for value in values:
        if isinstance(value, bool) or (isinstance(value, str) and not is_plain(value)):
            raise broken(f"its coordinates are not numbers: {value!r}", pointer)
    try:
        flat = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise broken("its coordinates are not numbers", pointer) from error
    if flat.ndim != 1 or len(flat) % 2:
        raise broken("its coordinates are not pairs of x and y", pointer)
    if not np.isfinite(flat).all():
        raise broken("a coordinate is not finite", pointer)
    return np.clip(flat, -_FARTHEST, _FARTHEST).reshape(-1, 2)


def finite(value: object, pointer: str) -> float:
    """One finite number; raises `InputError` on anything else."""
    return float(ring_from([value, 0], pointer)[0, 0])


def counts_from(values: Sequence[object], area: int, pointer: str) -> Counts:
    """Run lengths that fill `area` pixels exactly; raises `InputError` on anything else."""
    try:
        counts = np.array(values or [0])
    except ValueError as error:
        raise broken("its run lengths are not whole numbers", pointer) from error
    if counts.ndim != 1 or counts.dtype.kind not in "iu":
        raise broken("its run lengths are not whole numbers", pointer)
    if (counts < 0).any() or (counts > area).any() or int(counts.sum()) != area:
        raise broken(f"its run lengths do not add up to the {area} pixels of the mask", pointer)
    return counts.astype(np.int64)


def rectangle(left: float, top: float, right: float, bottom: float) -> Ring:
    return np.array([[left, top], [right, top], [right, bottom], [left, bottom]], dtype=np.float64)


def ellipse_vertices(rx: float, ry: float) -> int:
    """Vertices of a polygon that stays within 1/100 px of an ellipse with these radii."""
    radius = max(abs(rx), abs(ry), 0.02)
    return max(math.ceil(math.pi / math.acos(1 - 0.01 / radius)), 16)


def ellipse(cx: float, cy: float, rx: float, ry: float) -> Ring:
    """An ellipse as a polygon that stays within 1/100 px of it."""
    angle = np.linspace(0, 2 * math.pi, ellipse_vertices(rx, ry), endpoint=False)
    return np.column_stack([cx + rx * np.cos(angle), cy + ry * np.sin(angle)])


def rotated(ring: Ring, degrees: float, cx: float, cy: float) -> Ring:
    """The ring turned about `(cx, cy)`, clockwise as seen on the screen (y points down)."""
    if degrees == 0:
        return ring
    turn = math.radians(degrees)
    matrix = np.array([[math.cos(turn), math.sin(turn)], [-math.sin(turn), math.cos(turn)]])
    centre = np.array([cx, cy])
    return np.asarray((ring - centre) @ matrix + centre, dtype=np.float64)
