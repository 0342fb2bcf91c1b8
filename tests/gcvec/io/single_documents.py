"""The readers of single annotation files, as functions, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable

from gcvec.annotations import Annotations
from gcvec.errors import InputError
from gcvec.io import DEFAULT_LIMITS, Limits
from gcvec.io.coco import CocoDocument
from gcvec.io.cvat_xml import CvatDocument
from gcvec.io.selection import select_image


def read_coco(
    data: bytes,
    image_name: str | None = None,
    picture_name: str | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> Annotations:
    document = CocoDocument(data, limits)
    return document.annotations(select_image(document.names, image_name, picture_name))


def read_cvat_xml(
    data: bytes,
    image_name: str | None = None,
    picture_name: str | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> Annotations:
    document = CvatDocument(data, limits)
    return document.annotations(select_image(document.names, image_name, picture_name))


def read_or_refused(read: Callable[[], Annotations]) -> Annotations | InputError:
    """What is read, or why it is not: anything else that is raised goes on."""
    try:
        return read()
    except InputError as error:
        return error
