"""Work that something has to be kept up for while it is done."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from contextvars import copy_context
from types import TracebackType
from typing import Self


class StopError(Exception):
    """The run must end: the job was cancelled, has run out of time or belongs to another attempt by now."""


class Keeper(ABC):
    """Keeps something up in a thread of its own while the body of a `with` statement computes.

    `_stopped` is set when the work is no longer wanted, `_done` when it has ended.
    """

    def __init__(self, name: str) -> None:
        self._stopped = threading.Event()
        self._done = threading.Event()
        self._thread = threading.Thread(target=copy_context().run, args=(self._keep,), name=name, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._done.set()
        self._thread.join()

    def check(self) -> None:
        """Raise StopError if the work is no longer wanted."""
        if self._stopped.is_set():
            raise StopError

    @abstractmethod
    def _keep(self) -> None:
        """Runs in the thread, until `_done` is set."""
