"""CVAT for images 1.1: polygons, boxes, ellipses and masks of one image."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.parsers.expat import errors
from xml.sax import SAXParseException
from xml.sax.handler import ContentHandler
from xml.sax.xmlreader import AttributesImpl, Locator

import defusedxml.sax
from defusedxml import DefusedXmlException

from gcvec.annotations import Annotations, Shape
from gcvec.errors import InputError
from gcvec.io.geometry import (
    Ring,
    broken,
    counts_from,
    cut_off,
    ellipse,
    ellipse_vertices,
    finite,
    is_plain,
    rectangle,
    ring_from,
    rotated,
)
from gcvec.io.limits import Account, Limits, require_few_images
from gcvec.io.rle import row_major_mask

_REGIONS = ("polygon", "box", "ellipse", "mask")
_TASK = ("id", "name", "subset")
_NOT_REGIONS = ("polyline", "points", "skeleton", "cuboid")


class CvatDocument:
    """A "CVAT for images 1.1" document, parsed.

    `names` has for each image what it may be called. Raises `InputError`, and MemoryError.
    """

    def __init__(self, data: bytes, limits: Limits) -> None:
        self._limits = limits
        self._images, tasks = _parse(data, limits)
        self.names = [_names(image, tasks) for image in self._images]

    def annotations(self, index: int) -> Annotations:
        """The regions of an image. Raises `InputError`.

        Polylines, points, skeletons and cuboids enclose no region and are left out with a warning.
        """
        image = self._images[index]
        account = Account(self._limits)
        shapes = tuple(_shape(element, image, account) for element in image.regions)
        return Annotations(shapes, image.width, image.height, _left_out(image.ignored))


@dataclass(frozen=True)
class _Element:
    tag: str
    attributes: Mapping[str, str]
    pointer: str


@dataclass
class _Image:
    name: str
    subset: str
    task: str
    width: int
    height: int
    regions: list[_Element] = field(default_factory=list)
    ignored: Counter[str] = field(default_factory=Counter)


class _Document(ContentHandler):
    """Collects the images and their elements, with the line each stands on, and the tasks by id."""

    def __init__(self, limits: Limits) -> None:
        super().__init__()
        self._limits = limits
        self.images: list[_Image] = []
        self.tasks: dict[str, Mapping[str, str]] = {}
        self._task = dict.fromkeys(_TASK, "")
        self._text: list[str] = []
        self._path: list[str] = []
        self._locator: Locator | None = None

    def setDocumentLocator(self, locator: Locator) -> None:  # noqa: N802 - SAX has named it
        self._locator = locator

    def startElement(self, name: str, attrs: AttributesImpl) -> None:  # noqa: N802 - SAX has named it
        parents = self._path
        if not parents and name != "annotations":
            raise _unsupported(f"the root element is <{name}>, not <annotations>")
        if parents == ["annotations"]:
            if name == "track":
                raise _unsupported("this is CVAT for video; export the task as CVAT for images 1.1")
            if name == "image":
                self.images.append(self._image(attrs))
                require_few_images(len(self.images), self._limits)
        elif parents == ["annotations", "image"]:
            self._add(self.images[-1], name, attrs)
        elif parents[1:2] == ["meta"]:
            self._text = []
            if name == "task":
                self._task = dict.fromkeys(_TASK, "")
        parents.append(name)

    def characters(self, content: str) -> None:
        if self._path[-2:-1] == ["task"]:
            self._text.append(content)

    def endElement(self, name: str) -> None:  # noqa: N802 - SAX has named it
        parents = self._path
        parents.pop()
        if parents[1:2] != ["meta"]:
            return
        if parents[-1] == "task" and name in _TASK:
            self._task[name] = "".join(self._text).strip()
        elif name == "task":
            self.tasks[self._task["id"]] = self._task

    def _image(self, attrs: AttributesImpl) -> _Image:
        pointer = f"image {attrs.get('name', '')!r}, line {self._line()}"
        width, height = (_whole(attrs, key, pointer) for key in ("width", "height"))
        name, subset, task = (attrs.get(key, "") for key in ("name", "subset", "task_id"))
        return _Image(name, subset, task, width, height)

    def _add(self, image: _Image, name: str, attrs: AttributesImpl) -> None:
        if name in _REGIONS:
            pointer = f"{name} {len(image.regions) + 1}, line {self._line()}"
            image.regions.append(_Element(name, dict(attrs), pointer))
        elif name in _NOT_REGIONS:
            image.ignored[name] += 1

    def _line(self) -> int:
        return (self._locator and self._locator.getLineNumber()) or 0


def _parse(data: bytes, limits: Limits) -> tuple[list[_Image], Mapping[str, Mapping[str, str]]]:
    """The images of a document, and by id what `_TASK` names of its tasks."""
    document = _Document(limits)
    try:
        defusedxml.sax.parseString(data, document, forbid_dtd=True)
    except SAXParseException as error:
        if error.getMessage() == errors.XML_ERROR_NO_MEMORY:  # which is no fault of the file's
            raise MemoryError from error
        line = error.getLineNumber()
        raise InputError(
            f"broken annotations: line {line}: {error.getMessage()}",
            code="broken-annotations",
            pointer=f"line {line}",
        ) from error
    except DefusedXmlException as error:
        raise InputError(
            "annotations refused: the XML declares a document type or entities", code="unsafe-annotations"
        ) from error
    except InputError:
        raise
    except (LookupError, ValueError) as error:  # what expat makes of strange encodings
        raise InputError(f"broken annotations: {error}", code="broken-annotations") from error
    return document.images, document.tasks


def _names(image: _Image, tasks: Mapping[str, Mapping[str, str]]) -> list[str]:
    """What an image may be called: its name, also behind those of its subset, of its task, and of both.

    The images of a project come from several tasks, which may each have one of the same name. Some versions
    of CVAT state one task for all images: it is not that of an image in another subset.
    """
    subset, stated = image.subset, tasks.get(image.task, {})
    task = stated["name"] if stated and stated["subset"] in ("", subset) else ""
    folders = [[], [subset], [task], [subset, task]]
    return list(dict.fromkeys("/".join([*filter(None, parts), image.name]) for parts in folders))


def _unsupported(why: str) -> InputError:
    return InputError(f"unsupported annotations: {why}", code="unsupported-annotations")


def _left_out(ignored: Counter[str]) -> tuple[str, ...]:
    return tuple(f"{count} <{tag}> left out: encloses no region" for tag, count in sorted(ignored.items()))


def _shape(element: _Element, image: _Image, account: Account) -> Shape:
    attributes, pointer = element.attributes, element.pointer
    account.add_shape(pointer)
    label = attributes.get("label", "")
    z_order = _whole(attributes, "z_order", pointer)
    if element.tag == "mask":
        return _mask(attributes, image, pointer, account, label, z_order)
    if element.tag == "polygon":
        ring = _polygon(attributes, pointer, account)
    else:
        ring = (_box if element.tag == "box" else _ellipse)(attributes, pointer, account)
    return Shape(label, rings=(cut_off(ring),), z_order=z_order, pointer=pointer)


def _polygon(attributes: Mapping[str, str], pointer: str, account: Account) -> Ring:
    """`points="x,y;x,y;…"`; `points=""` is a polygon that covers nothing, as other small ones do."""
    if "points" not in attributes:
        raise broken("'points' is missing", pointer)
    text = attributes["points"].strip(" ;")
    if not text:
        return ring_from([], pointer)
    account.add_vertices(text.count(";") + 1, pointer)
    pairs = [pair.split(",") for pair in text.split(";")]
    if any(len(pair) != 2 for pair in pairs):
        raise broken("its points are not pairs 'x,y' separated by ';'", pointer)
    return ring_from([value for pair in pairs for value in pair], pointer)


def _box(attributes: Mapping[str, str], pointer: str, account: Account) -> Ring:
    account.add_vertices(4, pointer)
    left, top, right, bottom = (_number(attributes, key, pointer) for key in ("xtl", "ytl", "xbr", "ybr"))
    turn = _number(attributes, "rotation", pointer, default="0")
    return rotated(rectangle(left, top, right, bottom), turn, (left + right) / 2, (top + bottom) / 2)


def _ellipse(attributes: Mapping[str, str], pointer: str, account: Account) -> Ring:
    cx, cy, rx, ry = (_number(attributes, key, pointer) for key in ("cx", "cy", "rx", "ry"))
    account.add_vertices(ellipse_vertices(rx, ry), pointer)
    turn = _number(attributes, "rotation", pointer, default="0")
    return rotated(ellipse(cx, cy, rx, ry), turn, cx, cy)


def _mask_box(attributes: Mapping[str, str], image: _Image, pointer: str) -> tuple[int, int, int, int]:
    """The left, top, width and height of a mask, which may be left out where it is of the whole image."""
    whole = {"left": 0, "top": 0, "width": image.width, "height": image.height}
    box = {key: _whole(attributes, key, pointer) if key in attributes else whole[key] for key in whole}
    missing = [key for key in whole if key not in attributes]
    if unknown := next((key for key in missing if key in ("width", "height") and not whole[key]), None):
        raise broken(f"{unknown!r} is missing, and the image does not state it either", pointer)
    if missing and box != whole:
        raise broken(f"{missing[0]!r} is missing, and the mask is not of the whole image", pointer)
    return box["left"], box["top"], box["width"], box["height"]


def _mask(
    attributes: Mapping[str, str], image: _Image, pointer: str, account: Account, label: str, z_order: int
) -> Shape:
    left, top, width, height = _mask_box(attributes, image, pointer)
    if width < 1 or height < 1:
        raise broken(f"a mask of {width} x {height} pixels", pointer)
    account.add_mask(width * height, pointer)
    rle = attributes.get("rle", "")
    if not is_plain(rle):
        raise broken("its run lengths are not whole numbers", pointer)
    try:
        runs = [int(run) for run in rle.split(",")]
    except ValueError as error:
        raise broken("its run lengths are not whole numbers", pointer) from error
    mask = row_major_mask(counts_from(runs, width * height, pointer), width, height)
    return Shape(label, mask=mask, offset=(left, top), z_order=z_order, pointer=pointer)


def _number(attributes: Mapping[str, str], key: str, pointer: str, default: str | None = None) -> float:
    text = attributes.get(key, default)
    if text is None:
        raise broken(f"{key!r} is missing", pointer)
    return finite(text, pointer)


def _whole(attributes: Mapping[str, str] | AttributesImpl, key: str, pointer: str) -> int:
    """A whole number, 0 when the attribute is absent."""
    text = attributes.get(key, "0")
    try:
        return int(text if is_plain(text) else "")
    except ValueError as error:
        raise broken(f"{key}={text!r} is not a whole number", pointer) from error
