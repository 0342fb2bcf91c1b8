"""Puts right what a crash leaves behind. Every worker runs one; one begins about every two seconds."""

from __future__ import annotations

import json
import logging
import threading
import time
from base64 import b64decode
from contextlib import suppress
from typing import Any, Final

import redis
from kombu.exceptions import OperationalError

from worker import logs
from worker.app import app
from worker.queues import DELIVER, HOOKS_QUEUE, JOBS_QUEUE, REMOVE, SHORT_QUEUE, TIDY, VECTORIZE
from worker.records import JobRecords, connect
from worker.settings import get_settings
from worker.steps import ACTIVE, EXPIRY, LEASE_SECONDS, events_key, lease_key, record_key, requeue
from worker.webhooks import DELIVERIES, tries_key

logger = logging.getLogger(__name__)

_PERIOD: Final = 2.0
_LOST_AFTER: Final = 10.0
_BATCH: Final = 200
_TIDY_SECONDS: Final = 3600.0
_REMOVED_WITHIN: Final = 60.0
"""A job that has not been removed by then is sent to be removed again."""
_DELIVERED_WITHIN: Final = 120.0
"""Likewise for what a webhook is to be told."""


class Sweeper:
    """Sends jobs again whose attempt died or whose message was lost; has the store cleared of expired jobs.

    Every `tidy_seconds` it has files removed that belong to no job.
    """

    def __init__(self, client: redis.Redis, tidy_seconds: float) -> None:
        self._tidy_seconds = tidy_seconds
        self._client: Any = client
        self._records = JobRecords(client)

    def run_forever(self) -> None:
        while True:
            try:
                if self._client.set("gcvec:sweeper", "1", nx=True, px=int(_PERIOD * 900)):
                    self.sweep()
                time.sleep(_PERIOD)
            except Exception as error:
                if isinstance(error, redis.OutOfMemoryError):
                    self.make_room()
                if isinstance(error, (redis.RedisError, OperationalError)):
                    logger.warning("sweep failed: %s", type(error).__name__)
                else:
                    logger.exception("sweep failed")
                # After an outage running attempts get time to renew their leases before they count as dead.
                time.sleep(LEASE_SECONDS)

    def sweep(self) -> None:
        """Sweep once."""
        for job_id in self.lost():
            if self._records.run(requeue(job_id)):
                with logs.about(job_id):
                    logger.warning("job %s: sent again", job_id)
                app.send_task(VECTORIZE, [job_id])
        for job_id in self._due(EXPIRY, SHORT_QUEUE, _REMOVED_WITHIN):
            app.send_task(REMOVE, [job_id])
        for entry in self._due(DELIVERIES, HOOKS_QUEUE, _DELIVERED_WITHIN):
            app.send_task(DELIVER, [entry, int(self._client.get(tries_key(entry)) or 0)])
        if self._client.set("gcvec:tidied", "1", nx=True, px=int(1000 * self._tidy_seconds)):
            app.send_task(TIDY)

    def make_room(self) -> None:
        """Forget the events of expired jobs, which nobody may ask for: they are most of what Redis holds, and
        one that is full takes no message to have the rest removed."""
        with suppress(redis.RedisError):
            if expired := self._client.zrange(EXPIRY, 0, time.time(), byscore=True):
                self._client.delete(*map(events_key, expired))

    def _due(self, schedule: str, queue: str, seconds: float) -> list[str]:
        """What a schedule holds that its time has come for. It is due again after so many seconds.

        Nothing while many messages wait in the queue: that of what is due may be one of them.
        """
        if self._client.llen(queue) >= _BATCH:
            return []
        now = time.time()
        return [
            entry
            for entry in self._client.zrange(schedule, 0, now, byscore=True, offset=0, num=_BATCH)
            if self._client.zadd(schedule, {entry: now + seconds}, xx=True, ch=True)
        ]

    def lost(self) -> list[str]:
        """Unfinished jobs that nobody works on and that no message stands for.

        Messages are taken in the order in which jobs began to wait: a job that began well before the one
        whose turn is next has none any more.
        """
        jobs = self._client.zrange(ACTIVE, 0, -1, withscores=True)
        pipeline = self._client.pipeline(transaction=False)
        for job_id, _ in jobs:
            pipeline.hget(record_key(job_id), "status")
            pipeline.exists(lease_key(job_id))
        answers = pipeline.execute()
        overdue = self._next_began() - _LOST_AFTER
        return [
            job_id
            for (job_id, since), status, leased in zip(jobs, answers[::2], answers[1::2], strict=True)
            if not leased and (status != "queued" or since < overdue)
        ]

    def _next_began(self) -> float:
        """When the job whose turn is next began to wait; now, if none waits."""
        message = self._client.lindex(JOBS_QUEUE, -1)
        if message is None:
            return time.time()
        try:
            job_id = str(json.loads(b64decode(json.loads(message)["body"]))[0][0])
        except (ValueError, LookupError, TypeError):
            return 0.0  # not one of ours: the next one will tell
        since = self._client.zscore(ACTIVE, job_id)
        return 0.0 if since is None else float(since)  # it has ended: likewise


def start() -> None:
    """Sweep from now on, in a thread of this process."""
    settings = get_settings()
    tidy_seconds = min(_TIDY_SECONDS, settings.orphan_age.total_seconds())
    sweeper = Sweeper(connect(settings.broker_url, patient=False), tidy_seconds)
    threading.Thread(target=sweeper.run_forever, name="sweeper", daemon=True).start()
