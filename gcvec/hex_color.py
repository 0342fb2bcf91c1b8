"""Colours as people write them."""

from __future__ import annotations

import re

from gcvec.errors import InputError

_COLOR = re.compile("#?[0-9a-fA-F]{6}")


def rgb_from_hex(text: str, pointer: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour written as `#rrggbb` (the sign may be missing).

    Raises `InputError` ("bad-option") at the `pointer` for anything else.
    """
    if not _COLOR.fullmatch(text):
        raise InputError(f"{text!r} is not #rrggbb, such as #ffffff", code="bad-option", pointer=pointer)
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue
