"""COCO 1.0 instances: polygons, run-length masks and plain boxes of one image."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, NoReturn

from gcvec.annotations import Annotations, Shape
from gcvec.errors import InputError
from gcvec.io.geometry import broken, counts_from, cut_off, rectangle, ring_from
from gcvec.io.limits import Account, Limits, require_few_images
from gcvec.io.rle import ColumnRuns, decode_compressed_counts

_Json = Mapping[str, Any]


class CocoDocument:
    """A COCO instances file, parsed.

    `names` has for each image what it may be called. Raises `InputError`.
    """

    def __init__(self, data: bytes, limits: Limits) -> None:
        self._limits = limits
        self._content = _parse(data)
        self._images = _objects(self._content, "images")
        require_few_images(len(self._images), limits)
        self.names = [[_name(image, "file_name")] for image in self._images]

    def annotations(self, index: int) -> Annotations:
        """The regions of an image. Raises `InputError`.

        Several rings of one annotation are parts of one region. A run-length mask may be compressed or not.
        An annotation with a box alone is a rectangle; one of keypoints, whose box is none of a region, or
        with neither (captions) is left out with a warning.
        """
        image, place = self._images[index], f"images[{index}]"
        width, height = (_side(image.get(key, 0), self._limits, place) for key in ("width", "height"))
        categories = _objects(self._content, "categories")
        labels = {_name(c, "id"): _name(c, "name") or _name(c, "id") for c in categories}

        reader = _ShapeReader(width, height, self._limits)
        shapes: list[Shape] = []
        without_region = 0
        for number, annotation in enumerate(_objects(self._content, "annotations")):
            if _name(annotation, "image_id") != _name(image, "id"):
                continue
            if not _has_region(annotation):
                without_region += 1
                continue
            category = _name(annotation, "category_id")
            shapes.append(reader.shape(annotation, labels.get(category, category), f"annotations[{number}]"))
        plural = "s" if without_region > 1 else ""
        warnings = (f"{without_region} annotation{plural} without a region left out",)
        return Annotations(tuple(shapes), width, height, warnings if without_region else ())


def _parse(data: bytes) -> _Json:
    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is not a number")

    try:
        document = json.loads(data, parse_constant=refuse)
    except (ValueError, RecursionError) as error:
        raise InputError(f"broken annotations: {error}", code="broken-annotations") from error
    if not isinstance(document, dict) or "images" not in document:
        raise InputError(
            "unsupported annotations: the JSON is not COCO (it has no 'images')",
            code="unsupported-annotations",
        )
    return document


def _objects(document: _Json, key: str) -> list[_Json]:
    values = document.get(key, [])
    if not isinstance(values, list) or not all(isinstance(value, dict) for value in values):
        raise broken("not a list of objects", key)
    return values


def _whole(value: object) -> object:
    """200 for 200.0, as programs that know only floats write it."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


def _name(of: _Json, key: str) -> str:
    """What names something: 1, 1.0 and "1" are the same, null is as good as none."""
    value = _whole(of.get(key))
    return "" if value is None else str(value)


def _side(value: object, limits: Limits, pointer: str) -> int:
    """A width or height."""
    value = _whole(value)
    if not isinstance(value, int) or isinstance(value, bool) or not 0 <= value <= limits.max_side:
        raise broken(f"{value!r} is not a width or height of 0 to {limits.max_side} pixels", pointer)
    return value


def _is_drawn(segmentation: object) -> bool:
    """Whether there is more to a segmentation than null, or polygons without a vertex."""
    return any(segmentation) if isinstance(segmentation, list) else bool(segmentation)


def _has_region(annotation: _Json) -> bool:
    """Whether there is an outline, if an empty one, or a box to stand for it: that of keypoints does not."""
    segmentation = annotation.get("segmentation")
    if annotation.get("keypoints"):
        return _is_drawn(segmentation)
    return bool(segmentation or annotation.get("bbox"))


def _corners(bbox: object, pointer: str) -> list[float]:
    if not isinstance(bbox, list) or len(bbox) != 4:
        raise broken("its bbox is not [x, y, width, height]", pointer)
    (x, y), (width, height) = ring_from(bbox, pointer)
    if width < 0 or height < 0:
        raise broken("its bbox has a negative size", pointer)
    return [float(value) for value in rectangle(x, y, x + width, y + height).ravel()]


class _ShapeReader:
    """Reads the annotations of one image, keeping account of what they cost."""

    def __init__(self, width: int, height: int, limits: Limits) -> None:
        self._size = [height, width]
        self._limits = limits
        self._account = Account(limits)

    def shape(self, annotation: _Json, label: str, pointer: str) -> Shape:
        self._account.add_shape(pointer)
        segmentation = annotation.get("segmentation")
        if isinstance(segmentation, dict):
            return self._masked(segmentation, label, pointer)
        bbox = None if _is_drawn(segmentation) else annotation.get("bbox")
        rings = [_corners(bbox, pointer)] if bbox else segmentation
        if not isinstance(rings, list) or not all(isinstance(ring, list) for ring in rings):
            raise broken("its segmentation is neither a list of polygons nor a run-length mask", pointer)
        for ring in rings:
            self._account.add_vertices(len(ring) // 2, pointer)
        return Shape(label, rings=tuple(cut_off(ring_from(ring, pointer)) for ring in rings), pointer=pointer)

    def _masked(self, segmentation: _Json, label: str, pointer: str) -> Shape:
        height, width = self._mask_size(segmentation.get("size"), pointer)
        counts = segmentation.get("counts")
        if isinstance(counts, str):
            try:
                counts = decode_compressed_counts(counts)
            except ValueError as error:
                raise broken(str(error), pointer) from error
        if not isinstance(counts, list):
            raise broken("its run lengths are missing", pointer)
        whole = [_whole(count) for count in counts]
        runs = ColumnRuns(counts_from(whole, width * height, pointer), height)
        left, top, box_width, box_height = runs.box
        self._account.add_mask(box_width * box_height, pointer)
        return Shape(label, mask=runs.mask(), offset=(left, top), pointer=pointer)

    def _mask_size(self, stated: object, pointer: str) -> tuple[int, int]:
        """The mask's height and width: those of the picture that the file states."""
        if not isinstance(stated, list) or len(stated) != 2:
            raise broken("its mask has no size [height, width]", pointer)
        height, width = (_side(side, self._limits, pointer) for side in stated)
        for own, wanted, along in zip((height, width), self._size, ("high", "wide"), strict=True):
            if wanted not in (0, own):
                raise broken(f"its mask is {own} pixels {along}, the picture {wanted}", pointer)
        return height, width
