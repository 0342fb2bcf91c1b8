"""Annotated shapes -> label map: every pixel of the picture in exactly one connected region."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.annotations import Annotations, Shape
from gcvec.errors import InputError
from gcvec.plain_text import plain_label
from gcvec.regions.components import SLIVER_AREA, absorb_slivers, bridge_slivers, connected_components
from gcvec.regions.gaps import UNCOVERED, close_gaps
from gcvec.regions.polygon_fill import fill_ring

BACKGROUND = "background"
"""Name of the regions no shape covers."""

_POINTERS_SHOWN = 5


@dataclass(frozen=True)
class Partition:
    """The regions of a picture.

    `labels` is `(h, w) int32`: ids 0..n-1 in raster order of the regions' first pixels, each region
    4-connected; `names` holds the label of each region.
    """

    labels: NDArray[np.int32]
    names: tuple[str, ...]
    warnings: tuple[str, ...] = ()


def partition(annotations: Annotations, width: int, height: int) -> Partition:
    """Paint the shapes in z order (ties: later above) and settle what is left.

    Slivers under 16 px² that touch the rest of their shape at a corner are joined to it. Thin gaps between
    shapes go to the nearest one, the rest of what is uncovered becomes background; every 4-connected
    component is a region, except that slivers join the neighbour with the longest shared border. Shapes that
    end up without a pixel are named in `warnings`.

    Raises `InputError` ("no-usable-polygon") when no shape covers a pixel, "broken-annotations" for rings and
    masks that are none (see `Shape`).
    """
    for shape in annotations.shapes:
        _require_outline(shape)
    shapes = sorted(annotations.shapes, key=lambda shape: shape.z_order)
    notes = _Notes(shapes)
    owners = _painted(shapes, width, height, notes)
    painted = _present(owners)
    if not painted:
        raise _unusable("no shape covers a pixel of the picture", notes)
    bridge_slivers(owners)
    close_gaps(owners)
    owners[owners == UNCOVERED] = len(shapes)
    owners = absorb_slivers(owners)
    seen = _present(owners) - {len(shapes)}
    notes.add(f"dropped: under {SLIVER_AREA} px² of it can be seen", painted - seen)
    if not seen:
        raise _unusable(f"no shape covers {SLIVER_AREA} px² or more of the picture", notes)
    labels = connected_components(owners)
    names = [*(plain_label(shape.label) for shape in shapes), BACKGROUND]
    return Partition(
        labels,
        tuple(names[owner] for owner in _owner_of_region(labels, owners)),
        (*annotations.warnings, *notes.lines()),
    )


def _require_outline(shape: Shape) -> None:
    """Raise `InputError` for anything but rings `(n, 2)` of finite numbers, or a mask `(h, w) bool`."""
    if shape.mask is not None:
        if not _is_array(shape.mask, "b") or shape.mask.ndim != 2:
            raise _broken("a mask must be an array (h, w) of bool", shape)
    elif not all(_is_array(ring, "fiu") and ring.ndim == 2 and ring.shape[1] == 2 for ring in shape.rings):
        raise _broken("a ring must be an array (n, 2) of numbers", shape)
    elif not all(np.isfinite(ring).all() for ring in shape.rings):
        raise _broken("a coordinate is not finite", shape)


def _is_array(value: object, kinds: str) -> bool:
    """Whether this is an array, of one of these kinds of numbers (as numpy calls them)."""
    return isinstance(value, np.ndarray) and value.dtype.kind in kinds


def _broken(why: str, shape: Shape) -> InputError:
    return InputError(why, code="broken-annotations", pointer=shape.pointer or None)


class _Notes:
    """What happened to which shapes, told in one line a kind."""

    def __init__(self, shapes: list[Shape]) -> None:
        self._pointers = [shape.pointer or f"shape {i + 1}" for i, shape in enumerate(shapes)]
        self._indices: dict[str, list[int]] = defaultdict(list)

    def add(self, what: str, indices: Iterable[int]) -> None:
        self._indices[what].extend(sorted(indices))

    def lines(self) -> tuple[str, ...]:
        return tuple(self._line(what, indices) for what, indices in self._indices.items() if indices)

    def _line(self, what: str, indices: list[int]) -> str:
        shown = "; ".join(self._pointers[i] for i in indices[:_POINTERS_SHOWN])
        more = "; …" if len(indices) > _POINTERS_SHOWN else ""
        return f"{len(indices)} shape{'s' if len(indices) > 1 else ''} {what} ({shown}{more})"


def _unusable(what: str, notes: _Notes) -> InputError:
    return InputError("; ".join([what, *notes.lines()]), code="no-usable-polygon")


def _painted(shapes: list[Shape], width: int, height: int, notes: _Notes) -> NDArray[np.int32]:
    """Index of the topmost shape in every pixel, `UNCOVERED` where there is none."""
    owners = np.full((height, width), UNCOVERED, dtype=np.int32)
    painted = []
    repeated = _repeated(shapes)
    notes.add("dropped: another has the same outline", repeated)
    for index, shape in enumerate(shapes):
        if index in repeated:
            continue
        pixels, crosses_itself = _paint(owners, shape, index)
        if crosses_itself:
            notes.add("crossing itself, filled as outlined", [index])
        if pixels:
            painted.append(index)
        elif shape.mask is not None and not shape.mask.any():
            notes.add("dropped: its mask is empty", [index])
        elif _is_outside(shape, width, height):
            notes.add("dropped: outside the picture", [index])
        else:
            notes.add("dropped: too small to cover a pixel's centre", [index])
    notes.add("dropped: hidden under others", set(painted) - _present(owners))
    return owners


def _repeated(shapes: list[Shape]) -> set[int]:
    """Shapes whose outline is drawn again later, exactly: the last one, on top, stands for all."""
    last = {_outline(shape): index for index, shape in enumerate(shapes)}
    return set(range(len(shapes))) - set(last.values())


def _outline(shape: Shape) -> tuple[object, ...]:
    mask = (shape.offset, shape.mask.shape, shape.mask.tobytes()) if shape.mask is not None else ()
    return (*(ring.tobytes() for ring in shape.rings), mask)


def _paint(owners: NDArray[np.int32], shape: Shape, index: int) -> tuple[int, bool]:
    """Paint one shape; returns the number of pixels written and whether a ring crosses itself."""
    if shape.mask is not None:
        return _paint_mask(owners, shape.mask, shape.offset, index), False
    fills = [fill_ring(owners, ring, index) for ring in shape.rings]
    return sum(fill.pixels for fill in fills), any(fill.crosses_itself for fill in fills)


def _paint_mask(
    owners: NDArray[np.int32], mask: NDArray[np.bool_], offset: tuple[int, int], index: int
) -> int:
    height, width = owners.shape
    x, y = offset
    top, left = max(y, 0), max(x, 0)
    bottom, right = min(y + mask.shape[0], height), min(x + mask.shape[1], width)
    if top >= bottom or left >= right:
        return 0
    inside = mask[top - y : bottom - y, left - x : right - x]
    owners[top:bottom, left:right][inside] = index
    return int(inside.sum())


def _is_outside(shape: Shape, width: int, height: int) -> bool:
    if shape.mask is not None:
        (x, y), (h, w) = shape.offset, shape.mask.shape
        return x >= width or y >= height or x + w <= 0 or y + h <= 0
    points = np.concatenate(shape.rings) if shape.rings else np.empty((0, 2))
    if not len(points):
        return False
    (left, top), (right, bottom) = points.min(axis=0), points.max(axis=0)
    return bool(left >= width or top >= height or right <= 0 or bottom <= 0)


def _present(owners: NDArray[np.int32]) -> set[int]:
    """The shapes that own a pixel."""
    counts = np.bincount(owners.ravel() + 1)[1:]
    return set(np.flatnonzero(counts).tolist())


def _owner_of_region(labels: NDArray[np.int32], owners: NDArray[np.int32]) -> list[int]:
    found = np.empty(labels.max() + 1, dtype=np.int64)
    found[labels.ravel()] = owners.ravel()
    return [int(owner) for owner in found]
