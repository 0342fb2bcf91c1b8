"""The records of jobs, as workers read and change them."""

from __future__ import annotations

from typing import cast

import redis
from redis.backoff import ExponentialBackoff, NoBackoff
from redis.retry import Retry

from worker.job import Job
from worker.steps import Call, record_key, revision_field


def connect(broker_url: str, *, patient: bool) -> redis.Redis:
    """A connection to Redis. A patient one waits minutes for a server that is away, another fails at once."""
    retry = Retry(ExponentialBackoff(cap=2, base=0.1), 300) if patient else Retry(NoBackoff(), 0)
    return redis.Redis.from_url(
        broker_url,
        decode_responses=True,
        socket_connect_timeout=2,
        socket_timeout=5,
        retry=retry,
        retry_on_error=[redis.ConnectionError, redis.TimeoutError] if patient else [],
    )


class JobRecords:
    """The records as workers use them."""

    def __init__(self, client: redis.Redis) -> None:
        self._client = client

    @property
    def client(self) -> redis.Redis:
        """The connection."""
        return self._client

    def run(self, call: Call) -> int:
        """Run one of the steps of `worker.steps`."""
        return int(self._client.register_script(call.script)(keys=call.keys, args=call.args))

    def unwanted(self, job_id: str) -> bool:
        """Whether the job was cancelled or deleted. One of which nothing is known may just be forgotten."""
        fields = cast("dict[str, str]", self._client.hgetall(record_key(job_id)))
        return bool(fields) and fields.get("status") in (None, "canceled")

    def revision_for(self, job_id: str, question: str) -> int:
        """The number of the revision for which a question has asked before; 0 if it has not."""
        return int(cast("str | None", self._client.hget(record_key(job_id), revision_field(question))) or 0)

    def get(self, job_id: str) -> Job | None:
        fields = cast("dict[str, str]", self._client.hgetall(record_key(job_id)))
        return Job.from_fields(job_id, fields)
