"""What can go wrong, named so that a person, a script and an HTTP client can each act on it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """The input cannot be used. The message names the cause in one line.

    `code` is a stable slug such as ``"unreadable-picture"``; `pointer` names the offending part of the input
    where there is one (``"polygon 3, line 41"``).
    """

    def __init__(self, message: str, *, code: str, pointer: str | None = None) -> None:
        super().__init__(message)
        self.code = code
        self.pointer = pointer


class FailureError(Exception):
    """A command has failed, and not for its input. The message names the cause in one line."""


@contextmanager
def pointing_at(part: str) -> Iterator[None]:
    """Let an `InputError` raised inside point at `part` of the input, unless it points at something."""
    try:
        yield
    except InputError as error:
        if error.pointer is not None:
            raise
        raise InputError(str(error), code=error.code, pointer=part) from error
