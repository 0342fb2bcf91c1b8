"""Region annotations in, whichever of the known formats the bytes are."""

from __future__ import annotations

import zlib
from io import BytesIO
from pathlib import PurePosixPath
from zipfile import ZIP_DEFLATED, ZIP_STORED, BadZipFile, ZipFile, ZipInfo

from gcvec.annotations import Annotations
from gcvec.errors import InputError
from gcvec.io.coco import read_coco
from gcvec.io.cvat_xml import read_cvat_xml
from gcvec.io.limits import DEFAULT_LIMITS, Limits

_BLANK = b"\xef\xbb\xbf\xff\xfe\x00 \t\r\n"
"""Byte-order marks, blanks and the zero bytes of UTF-16: what may stand before the first character."""

_MAX_ZIP_ENTRIES = 10_000
_ENTRY_SIGNATURE = b"PK\x01\x02"


def read_annotations(
    data: bytes,
    *,
    image_name: str | None = None,
    picture_name: str | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> Annotations:
    """The regions of one image from CVAT for images 1.1 (XML), COCO 1.0 (JSON) or a zip holding either.

    `image_name` names the image in the file and must be found; without it the image named most like
    `picture_name`, a file's name or path, is taken, else the only one (see `select_image`).

    Raises `InputError`: "broken-annotations", "unsupported-annotations", "unsafe-annotations",
    "annotations-too-large", "unknown-image"; and MemoryError.
    """
    if data.startswith(b"PK"):
        data = _unzipped(data, limits)
    if len(data) > limits.annotation_bytes:
        raise _too_large(limits)
    first = data.lstrip(_BLANK)[:1]
    if first == b"<":
        return read_cvat_xml(data, image_name=image_name, picture_name=picture_name, limits=limits)
    if first in (b"{", b"["):
        return read_coco(data, image_name=image_name, picture_name=picture_name, limits=limits)
    raise InputError(
        "unsupported annotations: neither CVAT XML nor COCO JSON nor a zip holding one",
        code="unsupported-annotations",
    )


def _unzipped(data: bytes, limits: Limits) -> bytes:
    """The one annotation document of a zip archive; nothing is written to disk."""
    if data.count(_ENTRY_SIGNATURE) > _MAX_ZIP_ENTRIES:
        raise InputError("the zip holds too many files", code="unsafe-annotations")
    try:
        with ZipFile(BytesIO(data)) as archive:
            entry = _document(archive.infolist())
            with archive.open(entry) as stream:
                document = stream.read(limits.annotation_bytes + 1)
    except (BadZipFile, zlib.error, EOFError, NotImplementedError, OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"broken annotations: unreadable zip ({error})", code="broken-annotations"
        ) from error
    if len(document) > limits.annotation_bytes:
        raise _too_large(limits)
    return document


def _document(entries: list[ZipInfo]) -> ZipInfo:
    for entry in entries:
        path = PurePosixPath(entry.filename.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts or entry.filename[1:2] == ":":
            raise InputError(f"the zip holds an unsafe path: {entry.filename!r}", code="unsafe-annotations")
    entries = [entry for entry in entries if not _is_of_macos(entry)]
    for ending in (".xml", ".json"):
        found = [entry for entry in entries if entry.filename.lower().endswith(ending)]
        if len(found) > 1:
            names = ", ".join(repr(entry.filename) for entry in found[:5])
            raise InputError(
                f"the zip holds several annotation files ({names}); pass the one meant",
                code="unsupported-annotations",
            )
        if found:
            return _readable(found[0])
    raise InputError("the zip holds no annotation file (.xml or .json)", code="unsupported-annotations")


def _is_of_macos(entry: ZipInfo) -> bool:
    """Whether a file only holds what macOS knows of another one, whose name it has."""
    return "__MACOSX" in entry.filename or PurePosixPath(entry.filename).name.startswith("._")


def _readable(entry: ZipInfo) -> ZipInfo:
    if entry.flag_bits & 1:
        raise InputError("the zip is encrypted", code="unsupported-annotations")
    if entry.compress_type not in (ZIP_STORED, ZIP_DEFLATED):
        raise InputError("the zip is compressed in an unusual way", code="unsupported-annotations")
    return entry


def _too_large(limits: Limits) -> InputError:
    megabytes = limits.annotation_bytes / 1e6
    return InputError(f"the annotations are larger than {megabytes:g} MB", code="annotations-too-large")
