"""One run of a job: it keeps the job's lease, reports progress and learns when it has to stop."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict
from types import TracebackType
from typing import Any, Final

import redis

from gcvec.progress import Progress
from worker import logs
from worker.keeper import Keeper
from worker.problems import problem
from worker.records import JobRecords
from worker.steps import EVENTS_KEPT, Call, finish, report

logger = logging.getLogger(__name__)

REPORT_SECONDS: Final = 0.2
RENEW_SECONDS: Final = 1.0
GRACE_SECONDS: Final = 2.0


class Attempt(Keeper):
    """The link between a computing thread and the job's record, kept by a thread of its own.

    The computation only appends to a queue and looks at a flag, so an outage of Redis neither slows nor fails
    it; events wait and are sent when the server is back. A computation that does not look at the flag for
    `GRACE_SECONDS` is ended with its process, which the worker replaces.
    """

    def __init__(
        self, records: JobRecords, job_id: str, number: int, *, seconds: float, retention: float
    ) -> None:
        super().__init__(f"attempt-{job_id}")
        self._records = records
        self._job_id = job_id
        self._number = number
        self._seconds = seconds
        self._retention = retention
        self._deadline = time.monotonic() + seconds
        self._outage = logs.Outage(
            logger, f"job {job_id}: progress waits", f"job {job_id}: progress waits no longer"
        )
        self._events: deque[Mapping[str, Any]] = deque(maxlen=EVENTS_KEPT)
        self._n_events = 0  # those that have been sent too
        self._changing_events = threading.Lock()

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        super().__exit__(kind, error, trace)
        self._send()

    def on_progress(self, progress: Progress) -> None:
        """Queue an event. Raises StopError if the run must end."""
        with self._changing_events:
            self._events.append(asdict(progress))
            self._n_events += 1
        self.check()

    def _keep(self) -> None:
        renewed = 0.0
        while not self._stopped.is_set() and not self._done.wait(REPORT_SECONDS):
            now = time.monotonic()
            if now > self._deadline:
                self._run_out()
            elif self._events or now - renewed >= RENEW_SECONDS:
                self._send()
                renewed = now
        if self._stopped.is_set() and not self._done.wait(GRACE_SECONDS):
            logger.warning("job %s: still at work, so its process is ended", self._job_id)
            os.kill(os.getpid(), signal.SIGKILL)

    def _send(self) -> None:
        with self._changing_events:
            batch, self._events = self._events, deque(maxlen=EVENTS_KEPT)
            first = self._n_events - len(batch) + 1
        if self._tell(report(self._job_id, self._number, batch, first)):
            return
        with self._changing_events:
            batch.extend(self._events)  # the oldest make room where there are too many
            self._events = batch

    def _run_out(self) -> None:
        error = problem("time-limit", f"the job ran longer than {self._seconds:g} s")
        ended = finish(self._job_id, "failed", retention=self._retention, attempt=self._number, error=error)
        if self._tell(ended):
            self._stopped.set()

    def _tell(self, call: Call) -> bool:
        """Run a step of this attempt; False if it could not be run now or has come too late."""
        try:
            ours = self._records.run(call)
        except redis.RedisError as error:
            self._outage.goes_on(error)
            return False
        self._outage.is_over()
        if not ours:
            self._stopped.set()
        return bool(ours)
