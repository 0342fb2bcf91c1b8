"""Region annotations in, whichever of the known formats the bytes are."""

from __future__ import annotations

import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from io import BytesIO
from itertools import groupby
from pathlib import PurePath, PurePosixPath
from typing import NamedTuple
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo

from gcvec.annotations import Annotations
from gcvec.errors import InputError
from gcvec.io.coco import CocoDocument
from gcvec.io.cvat_xml import CvatDocument
from gcvec.io.limits import DEFAULT_LIMITS, Limits, require_few_images
from gcvec.io.selection import distinct_names, select_image

_Document = CvatDocument | CocoDocument

_BLANK = b"\xef\xbb\xbf\xff\xfe\x00 \t\r\n"
"""Byte-order marks, blanks and the zero bytes of UTF-16: what may stand before the first character."""

_MAX_ZIP_ENTRIES = 10_000
_ENTRY_SIGNATURE = b"PK\x01\x02"

_INSTANCES = "instances_"
_OTHER_TASKS = ("stuff_", "person_keypoints_", "panoptic_", "labels_", "captions_", "image_info_")
"""How COCO's files of other tasks begin; those that may have outlines come first."""

_LONGEST_PLACE = 100
"""Characters of a path in a zip that images are called by too."""


def read_annotations(
    data: bytes,
    *,
    image_name: str | None = None,
    picture_name: str | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> Annotations:
    """The regions of one image from CVAT for images 1.1 (XML), COCO 1.0 (JSON) or a zip with either.

    `image_name` names the image in the annotations and must be found; without it the image named most like
    `picture_name`, a file's name or path, is taken, else the only one (see `select_image`). A zip may hold
    several annotation files, one for each subset of a project for instance: the one that lists the image is
    taken. An image may then also be called by the subset or the folder of that file, `train/cat.png`.

    Raises `InputError`: "broken-annotations", "unsupported-annotations", "unsafe-annotations",
    "annotations-too-large", "unknown-image"; and MemoryError.
    """
    images = _images(data, limits)
    image = images[select_image([image.names for image in images], image_name, picture_name)]
    with _naming(image.path):
        return image.document.annotations(image.position)


def image_name_for(data: bytes, path: str, limits: Limits = DEFAULT_LIMITS) -> str | None:
    """What the image of a picture at `path` is called in the annotations, if it takes its folders to tell;
    None where the name of its file will do.

    Raises `InputError` as `read_annotations` does.
    """
    names = [image.names for image in _images(data, limits)]
    chosen = select_image(names, None, path)
    with suppress(InputError):
        if select_image(names, None, PurePath(path).name) == chosen:
            return None
    return distinct_names(names, [chosen])[0]


class _Image(NamedTuple):
    """An annotated image: what it may be called, its document, its position there, and the path of the
    document where there are others in the zip."""

    names: Sequence[str]
    document: _Document
    position: int
    path: str


def _images(data: bytes, limits: Limits) -> list[_Image]:
    if data.startswith(b"PK"):
        documents = _unzipped(data, limits)
    else:
        if len(data) > limits.annotation_bytes:
            raise _too_large(limits)
        documents = {"": _parsed(data, limits)}
    if len(documents) == 1:
        (document,) = documents.values()
        return [_Image(names, document, position, "") for position, names in enumerate(document.names)]
    return [
        _Image([*names, *(f"{place}/{names[0]}" for place in places)], document, position, path)
        for path, document in documents.items()
        for places in [_places(path)]
        for position, names in enumerate(document.names)
    ]


def _parsed(data: bytes, limits: Limits) -> _Document:
    first = data.lstrip(_BLANK)[:1]
    if first == b"<":
        return CvatDocument(data, limits)
    if first in (b"{", b"["):
        return CocoDocument(data, limits)
    raise InputError(
        "unsupported annotations: neither CVAT XML nor COCO JSON nor a zip holding one",
        code="unsupported-annotations",
    )


def _places(path: str) -> list[str]:
    """What may stand before the names of the images that a file in a zip lists, `train/cat.png`: its subset,
    which it is named after, its folder, or both."""
    if len(path) > _LONGEST_PLACE:
        return []
    folder, subset = PurePosixPath(path).parent, PurePosixPath(path).stem
    for task in (_INSTANCES, *_OTHER_TASKS):
        subset = subset.removeprefix(task)
    return list(dict.fromkeys(str(place) for place in (PurePosixPath(subset), folder, folder / subset)))


@contextmanager
def _naming(path: str) -> Iterator[None]:
    """Let an error raised inside name the file in the zip that it is about, if there is a path."""
    try:
        yield
    except InputError as error:
        if not path:
            raise
        raise InputError(f"{path!r}: {error}", code=error.code, pointer=error.pointer) from error


def _unzipped(data: bytes, limits: Limits) -> dict[str, _Document]:
    """The annotations in a zip by their paths: of those kinds of files that hold any, the first.

    Nothing is written to disk, and whatever is read counts towards the one limit.
    """
    if data.count(_ENTRY_SIGNATURE) > _MAX_ZIP_ENTRIES:
        raise InputError("the zip holds too many files", code="unsafe-annotations")
    with _telling_of_damage():
        archive = ZipFile(BytesIO(data))
    with archive:
        entries = sorted(_candidates(archive.infolist()), key=_kind)
        left, images, refusal = limits.annotation_bytes, 0, None
        for _, of_kind in groupby(entries, _kind):
            found: dict[str, _Document] = {}
            for entry in of_kind:
                try:
                    with _naming(_path(entry) if len(entries) > 1 else ""):
                        content = _content(archive, entry, left, limits)
                        left -= len(content)
                        document = _parsed(content, limits)
                        images += len(document.names)
                        require_few_images(images, limits)
                        found[_path(entry)] = document
                except InputError as error:
                    if error.code != "unsupported-annotations":
                        raise
                    refusal = refusal or error
            if found:
                return found
    raise refusal or InputError(
        "the zip holds no annotation file (.xml or .json)", code="unsupported-annotations"
    )


def _candidates(entries: Sequence[ZipInfo]) -> list[ZipInfo]:
    """The files in a zip that may be annotations."""
    for entry in entries:
        path = PurePosixPath(_path(entry))
        if path.is_absolute() or ".." in path.parts or entry.filename[1:2] == ":":
            raise InputError(f"the zip holds an unsafe path: {entry.filename!r}", code="unsafe-annotations")
    return [e for e in entries if e.filename.lower().endswith((".xml", ".json")) and not _is_of_macos(e)]


def _path(entry: ZipInfo) -> str:
    return entry.filename.replace("\\", "/")


def _is_of_macos(entry: ZipInfo) -> bool:
    """Whether a file only holds what macOS knows of another one, whose name it has."""
    return "__MACOSX" in entry.filename or PurePosixPath(entry.filename).name.startswith("._")


def _kind(entry: ZipInfo) -> int:
    """Of what kind a file is by its name, those first that are most likely to be meant: CVAT's, COCO's of
    instances, any other, COCO's of other tasks."""
    name = PurePosixPath(_path(entry)).name
    if name.lower().endswith(".xml"):
        return 0
    if name.startswith(_INSTANCES):
        return 1
    return next((3 + i for i, task in enumerate(_OTHER_TASKS) if name.startswith(task)), 2)


def _content(archive: ZipFile, entry: ZipInfo, left: int, limits: Limits) -> bytes:
    """What a file in a zip holds, of which no more than `left` bytes are accepted."""
    if entry.flag_bits & 1:
        raise InputError("the zip is encrypted", code="unsupported-annotations")
    if entry.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise InputError("the zip is compressed in an unusual way", code="unsupported-annotations")
    with _telling_of_damage(), archive.open(entry) as stream:
        content = stream.read(left + 1)
    if len(content) > left:
        raise _too_large(limits)
    return content


@contextmanager
def _telling_of_damage() -> Iterator[None]:
    """Let an error of zipfile's be told as what it means."""
    try:
        yield
    except (BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, ValueError) as error:
        raise InputError(
            f"broken annotations: unreadable zip ({error})", code="broken-annotations"
        ) from error


def _too_large(limits: Limits) -> InputError:
    megabytes = limits.annotation_bytes / 1e6
    return InputError(f"the annotations are larger than {megabytes:g} MB", code="annotations-too-large")
