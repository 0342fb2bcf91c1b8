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
"""Shapes are cut off here, far outside of any picture: beyond it the slopes of edges lose their precision."""

_LARGEST = 1e100
"""Coordinates beyond this are taken for it, so that sums and products of them stay finite."""


def broken(message: str, pointer: str) -> InputError:
    return InputError(f"{pointer}: {message}", code="broken-annotations", pointer=pointer)


def is_plain(text: str) -> bool:
    """Whether text is written as other programs write numbers: Python takes digits of every script, and 1_0
    for 10."""
    return text.isascii() and "_" not in text


def ring_from(values: Sequence[object], pointer: str) -> Ring:
    """A ring `(n, 2)` from x, y, x, y …, held within `_LARGEST`; raises `InputError` on anything but pairs
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
    return np.clip(flat, -_LARGEST, _LARGEST).reshape(-1, 2)


def cut_off(ring: Ring) -> Ring:
    """The ring without what lies beyond `_FARTHEST`. Inside of it, what the ring encloses stays the same; one
    that is nowhere inside stays outside."""
    for axis in (0, 1):
        for side in (-1, 1):
            ring = _cut_off(ring, axis, side)
    return ring


def _cut_off(ring: Ring, axis: int, side: int) -> Ring:
    """The ring without what lies beyond `_FARTHEST` along one half of an axis (Sutherland and Hodgman)."""
    beyond = side * ring[:, axis] - _FARTHEST
    if not (beyond > 0).any():
        return ring
    if (beyond > 0).all():
        return np.clip(ring, -_FARTHEST, _FARTHEST)
    following, beyond_following = np.roll(ring, -1, axis=0), np.roll(beyond, -1)
    stays = beyond <= 0
    crosses = stays != (beyond_following <= 0)
    # Each edge is followed from the end that stays: from the other one, precision would be lost.
    start, end = np.where(stays[:, None], [ring, following], [following, ring])
    before, after = np.where(stays, [beyond, beyond_following], [beyond_following, beyond])
    share = before / np.where(crosses, before - after, 1)
    crossings = start + share[:, None] * (end - start)
    crossings[:, axis] = side * _FARTHEST
    kept: Ring = np.stack([ring, crossings], axis=1)[np.stack([stays, crosses], axis=1)]
    return kept


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
    return max(math.ceil(math.pi / (2 * math.asin(math.sqrt(0.005 / radius)))), 16)


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
