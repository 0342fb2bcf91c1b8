"""The readers of single annotation files, as functions, and what they refuse."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from gcvec.annotations import Annotations
from gcvec.errors import InputError
from gcvec.io import DEFAULT_LIMITS, Limits
from gcvec.io.coco import CocoDocument
from gcvec.io.cvat_xml import CvatDocument
from gcvec.io.selection import select_image


def _read(
    kind: type[CocoDocument | CvatDocument],
    data: bytes,
    image_name: str | None = None,
    picture_name: str | None = None,
    limits: Limits = DEFAULT_LIMITS,
) -> Annotations:
    document = kind(data, limits)
    return document.annotations(select_image(document.names, image_name, picture_name))


read_coco, read_cvat_xml = partial(_read, CocoDocument), partial(_read, CvatDocument)


def read_or_refused(read: Callable[[], Annotations]) -> Annotations | InputError:
    """What is read, or why it is not: anything else that is raised goes on."""
    try:
        return read()
    except InputError as error:
        return error
