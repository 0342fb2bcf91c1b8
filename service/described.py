"""Headers of answers, as the interface description has them."""

from __future__ import annotations

from typing import Any, Final

_HEADERS: Final[dict[str, tuple[str, dict[str, str]]]] = {
    "Content-Range": ("which of the file's bytes these are, and how many it has", {"type": "string"}),
    "ETag": ("the SHA-256 of the file; weak where the answer is compressed", {"type": "string"}),
    "Location": ("the address of it", {"type": "string"}),
    "Retry-After": ("seconds after which to ask again", {"type": "integer"}),
    "WWW-Authenticate": ("how to send a key: Bearer", {"type": "string"}),
}


def answer_headers(*names: str, always: bool = True) -> dict[str, Any]:
    """The headers of an answer that each such answer has, or only some have where `always` is false."""
    return {
        name: {"description": meaning, "required": always, "schema": schema}
        for name in names
        for meaning, schema in [_HEADERS[name]]
    }
