"""What a job is, as its record tells it."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

from worker.fields import known_fields

Status = Literal["queued", "running", "succeeded", "failed", "canceled"]
TERMINAL: Final = frozenset({"succeeded", "failed", "canceled"})


@dataclass(frozen=True)
class Job:
    """One job as its record tells it. Times are seconds since the epoch."""

    id: str
    owner: str
    status: Status
    created_at: float
    request: Mapping[str, Any] = field(default_factory=dict)
    attempt: int = 0
    started_at: float | None = None
    finished_at: float | None = None
    expires_at: float | None = None
    progress: Mapping[str, Any] | None = None
    error: Mapping[str, Any] | None = None
    warnings: tuple[str, ...] = ()
    bytes: int = 0
    revisions: int = 0
    last_event: int = 0
    webhook: Mapping[str, Any] | None = None

    @property
    def finished(self) -> bool:
        return self.status in TERMINAL

    @property
    def expired(self) -> bool:
        return self.expires_at is not None and self.expires_at <= time.time()

    def to_fields(self) -> dict[str, str]:
        """The record's hash. Strings stand as they are, for scripts to compare; the rest is JSON."""
        return {
            name: value if isinstance(value, str) else json.dumps(value)
            for name, value in vars(self).items()
            if name != "id" and value is not None
        }

    @classmethod
    def from_fields(cls, job_id: str, fields: Mapping[str, str]) -> Job | None:
        """The job, or None where the hash is empty or only says that the job is gone."""
        if "created_at" not in fields:
            return None
        plain = {"owner", "status"}
        values: dict[str, Any] = {
            name: value if name in plain else json.loads(value)
            for name, value in known_fields(cls, fields).items()
        }
        values["warnings"] = tuple(values["warnings"])
        return cls(id=job_id, **values)
