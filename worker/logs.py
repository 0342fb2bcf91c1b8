"""One line a log record, for people or, as JSON, for programs; the latter names the job it is about."""

from __future__ import annotations

import logging
import sys
import time
from contextlib import AbstractContextManager
from typing import Final

import structlog
from structlog.contextvars import bind_contextvars, bound_contextvars, merge_contextvars

from worker.settings import Settings

_REMINDER_SECONDS: Final = 60.0
_TEXT: Final = "%(asctime)s %(levelname)s %(name)s: %(message)s"


def start(settings: Settings, level: int = logging.INFO) -> None:
    """Write all records of this process from now on to standard error."""
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_json() if settings.log_format == "json" else logging.Formatter(_TEXT))
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(level)
    logging.getLogger("httpx").setLevel(
        logging.WARNING
    )  # else it tells the addresses of webhooks, keys and all


def about(job_id: str) -> AbstractContextManager[None]:
    """Records written within are about this job."""
    return bound_contextvars(job=job_id)


def from_now_on_about(job_id: str) -> None:
    """Records written by the rest of this request are about this job."""
    bind_contextvars(job=job_id)


class Outage:
    """Tells of what is tried again and again: that it fails, once a minute, and when that is over."""

    def __init__(self, logger: logging.Logger, during: str, after: str) -> None:
        self._logger = logger
        self._during = during
        self._after = after
        self._told: float | None = None

    def goes_on(self, error: Exception) -> None:
        """It has failed, once more perhaps."""
        now = time.monotonic()
        if self._told is None or now - self._told >= _REMINDER_SECONDS:
            self._logger.warning("%s (%s)", self._during, type(error).__name__)
            self._told = now

    def is_over(self) -> None:
        """It has not failed."""
        if self._told is not None:
            self._logger.info("%s", self._after)
            self._told = None


def _json() -> logging.Formatter:
    return structlog.stdlib.ProcessorFormatter(
        foreign_pre_chain=[
            merge_contextvars,
            structlog.stdlib.add_log_level,
            structlog.stdlib.add_logger_name,
            structlog.processors.TimeStamper(fmt="iso", utc=True, key="time"),
            structlog.processors.format_exc_info,
        ],
        processors=[
            structlog.stdlib.ProcessorFormatter.remove_processors_meta,
            structlog.processors.EventRenamer("message"),
            structlog.processors.JSONRenderer(),
        ],
    )
