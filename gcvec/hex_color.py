"""Colours as people write them."""

from __future__ import annotations

import re
from typing import Final

from gcvec.errors import InputError

HEX_COLOR: Final = "#?[0-9a-fA-F]{6}"
"""A regular expression for a colour, wherever one may be written: `#rrggbb`, or without the sign."""


def rgb_from_hex(text: str, pointer: str) -> tuple[int, int, int]:
    """Red, green and blue, 0 to 255, of a colour written as `HEX_COLOR`.

    Raises `InputError` ("bad-option") at the `pointer` for anything else.
    """
    if not re.fullmatch(HEX_COLOR, text):
        raise InputError(f"{text!r} is not #rrggbb, such as #ffffff", code="bad-option", pointer=pointer)
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue
