"""Job records as the API's event loop uses them, and the news of their changes."""

from __future__ import annotations

import asyncio
import json
import logging
import math
from collections import defaultdict
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any, Final

import redis.asyncio as redis
from redis.asyncio.retry import Retry
from redis.backoff import NoBackoff
from redis.exceptions import RedisError

from worker import logs
from worker.job import Job
from worker.orphans import FOREIGN_STORE
from worker.queues import QUEUES
from worker.steps import ACTIVE, CHANGES, STORED, TOTALS, Call, events_key, lease_key, owner_key, record_key

logger = logging.getLogger(__name__)

_CONNECTIONS: Final = 64
_RECONNECT_SECONDS: Final = 0.5
_PATIENCE_SECONDS: Final = 30.0


def connect(broker_url: str) -> redis.Redis:
    """A bounded pool of connections that fail quickly when the server is away."""
    pool = redis.BlockingConnectionPool.from_url(
        broker_url,
        max_connections=_CONNECTIONS,
        timeout=5,
        decode_responses=True,
        socket_connect_timeout=2,
        socket_timeout=5,
        retry=Retry(NoBackoff(), 1),
    )
    return redis.Redis.from_pool(pool)


@dataclass(frozen=True)
class Event:
    """One entry of a job's stream: `kind` is "progress" or "state"; numbers increase by one."""

    number: int
    kind: str
    data: str


@dataclass(frozen=True)
class Figures:
    """How the service stands: unfinished jobs by status, messages by queue, counts since the beginning.

    A job whose worker was killed waits for another, whatever its record still says.
    `foreign_store` says that the store belongs to another Redis.
    """

    unfinished: Mapping[str, int]
    messages: Mapping[str, int]
    oldest_queued: float | None
    totals: Mapping[str, float]
    foreign_store: bool


class JobRepository:
    """What the API reads and writes of the job records."""

    def __init__(self, client: redis.Redis) -> None:
        self._client: Any = client

    async def run(self, call: Call) -> int:
        """Run one of the steps of `worker.steps`."""
        return int(await self._client.register_script(call.script)(keys=call.keys, args=call.args))

    async def find(self, job_id: str) -> tuple[str | None, Job | None]:
        """The owner and the job; (owner, None) of a job that is gone, (None, None) of one that never was."""
        fields: Mapping[str, str] = await self._client.hgetall(record_key(job_id))
        return fields.get("owner"), _present(job_id, fields)

    async def stored(self, owner: str) -> int:
        """Bytes that the owner's files come to."""
        return int(await self._client.hget(STORED, owner) or 0)

    async def events(self, job_id: str, after: int) -> list[Event]:
        """The events numbered above `after`, in order."""
        entries = await self._client.xrange(events_key(job_id), min=f"({after}-0", count=500)
        return [Event(int(key.split("-")[0]), entry["type"], entry["data"]) for key, entry in entries]

    async def page(self, owner: str, before: tuple[float, str] | None, size: int) -> list[Job]:
        """The owner's jobs, newest first, older than the position `before` (time of creation, id)."""
        jobs: list[Job] = []
        offset = 0
        top = "+inf" if before is None else repr(before[0])
        while len(jobs) < size:
            entries = await self._client.zrange(
                owner_key(owner),
                top,
                "-inf",
                byscore=True,
                desc=True,
                offset=offset,
                num=size,
                withscores=True,
            )
            if not entries:
                break
            offset += len(entries)
            wanted = [key for key, score in entries if before is None or (score, key) < before]
            async with self._client.pipeline(transaction=False) as pipeline:
                for key in wanted:
                    pipeline.hgetall(record_key(key))
                records = await pipeline.execute()
            jobs += [job for job in map(_present, wanted, records) if job is not None]
        return jobs[:size]

    async def figures(self) -> Figures:
        """How the service stands now."""
        active = await self._client.zrange(ACTIVE, 0, -1, withscores=True)
        async with self._client.pipeline(transaction=False) as pipeline:
            for job_id, _ in active:
                pipeline.exists(lease_key(job_id))
            for queue in QUEUES:
                pipeline.llen(queue)
            pipeline.hgetall(TOTALS)
            pipeline.exists(FOREIGN_STORE)
            *answers, totals, foreign = await pipeline.execute()
        leased, lengths = answers[: len(active)], answers[len(active) :]
        waiting = [since for (_, since), held in zip(active, leased, strict=True) if not held]
        return Figures(
            unfinished={"queued": len(waiting), "running": len(active) - len(waiting)},
            messages=dict(zip(QUEUES, lengths, strict=True)),
            oldest_queued=min(waiting, default=None),
            totals={name: float(value) for name, value in totals.items()},
            foreign_store=bool(foreign),
        )

    async def ping(self) -> None:
        await self._client.ping()


class Changes:
    """Wakes those who wait for a job. One subscription a process, however many wait."""

    def __init__(self, client: redis.Redis) -> None:
        self._client: Any = client
        self._waiting: defaultdict[str, set[asyncio.Event]] = defaultdict(set)
        self._stopping = False

    @property
    def stopping(self) -> bool:
        """Whether the server is about to stop, so that nobody should wait any more."""
        return self._stopping

    def stop(self) -> None:
        """Wake everybody who waits: the server is about to stop."""
        self._stopping = True
        for topic in self._waiting:
            self._wake(topic)

    @asynccontextmanager
    async def watch(self, job_id: str, *, progress: bool) -> AsyncIterator[asyncio.Event]:
        """An event that is set when the job's state changes, and its progress if asked for.

        Whoever waits for it clears it before looking at the job.
        """
        topics = [f"state {job_id}", f"progress {job_id}"][: 1 + progress]
        async with self.listening(*topics) as event:
            yield event

    @asynccontextmanager
    async def listening(self, *topics: str) -> AsyncIterator[asyncio.Event]:
        """An event that is set on every news of one of `topics`."""
        event = asyncio.Event()
        for topic in topics:
            self._waiting[topic].add(event)
        try:
            yield event
        finally:
            for topic in topics:
                self._waiting[topic].discard(event)
                if not self._waiting[topic]:
                    del self._waiting[topic]

    async def listen(self) -> None:
        """Follow the changes until cancelled, across outages."""
        outage = logs.Outage(logger, "changes are not heard", "changes are heard again")
        while True:
            try:
                async with self._client.pubsub(ignore_subscribe_messages=True) as subscription:
                    await subscription.subscribe(CHANGES)
                    outage.is_over()
                    for topic in list(self._waiting):  # what happened while nobody listened
                        self._wake(topic)
                    while True:
                        message = await subscription.get_message(timeout=_PATIENCE_SECONDS)
                        if message is not None:
                            self._wake(message["data"])
            except RedisError as error:
                outage.goes_on(error)
                await asyncio.sleep(_RECONNECT_SECONDS)

    def _wake(self, topic: str) -> None:
        for event in self._waiting.get(topic, ()):
            event.set()


def cursor(job: Job) -> str:
    """The opaque position of a job in its owner's list."""
    return json.dumps([job.created_at, job.id]).encode().hex()


def position(text: str) -> tuple[float, str]:
    """The position that a cursor stands for. Raises ValueError."""
    created_at, job_id = json.loads(bytes.fromhex(text))
    if not math.isfinite(created_at):
        raise ValueError("a time that is none")
    return float(created_at), str(job_id)


def _present(job_id: str, fields: Mapping[str, str]) -> Job | None:
    """The job of a record, unless it is gone or has expired."""
    job = Job.from_fields(job_id, fields)
    return None if job is None or job.expired else job
