"""Which image of an annotation file belongs to the picture."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from pathlib import PurePosixPath

from gcvec.errors import InputError

_NAMES_SHOWN = 5


def select_image(names: Sequence[str], image_name: str | None, picture_name: str | None) -> int:
    """Index of the image meant, among the `names` an annotation file holds.

    `image_name` is a demand: it must be found. `picture_name`, the picture's own file name, is a hint: when
    it is not found the only image is taken. Both match exactly, else but for how accents are encoded (macOS
    writes them apart from their letters), else by base name, else without ending.

    Raises `InputError` ("unknown-image") when there is none, or no way to choose.
    """
    if not names:
        raise InputError("the annotation file holds no image", code="unknown-image")
    wanted = image_name if image_name is not None else picture_name
    if wanted is not None:
        matches = _matches(names, wanted)
        if len(matches) == 1:
            return matches[0]
        if len(matches) > 1:
            raise _unknown(f"several images match {wanted!r}", [names[i] for i in matches])
        if image_name is not None:
            raise _unknown(f"no image named {image_name!r}", names)
    if len(names) == 1:
        return 0
    raise _unknown("several images and none named like the picture; name the one meant", names)


def _matches(names: Sequence[str], wanted: str) -> list[int]:
    for key in (str, _composed, _base_name, _stem):
        found = [index for index, name in enumerate(names) if key(name) == key(wanted)]
        if found:
            return found
    return []


def _composed(name: str) -> str:
    return unicodedata.normalize("NFC", name)


def _base_name(name: str) -> str:
    return PurePosixPath(_composed(name).replace("\\", "/")).name


def _stem(name: str) -> str:
    return PurePosixPath(_base_name(name)).stem


def _unknown(what: str, names: Sequence[str]) -> InputError:
    shown = ", ".join(repr(name) for name in names[:_NAMES_SHOWN])
    more = f" and {len(names) - _NAMES_SHOWN} more" if len(names) > _NAMES_SHOWN else ""
    return InputError(f"{what} (the annotation file holds {shown}{more})", code="unknown-image")
