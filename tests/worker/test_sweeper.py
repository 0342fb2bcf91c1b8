from __future__ import annotations

import time
from collections.abc import Iterator

import pytest
import redis

from tests.broker import client_of
from worker import sweeper as sweeping
from worker.app import create_celery
from worker.job import Job
from worker.queues import HOOKS_QUEUE, JOBS_QUEUE, SHORT_QUEUE, VECTORIZE
from worker.records import JobRecords
from worker.settings import Settings
from worker.steps import EXPIRY, claim, create, events_key, finish, lease_key
from worker.sweeper import Sweeper
from worker.webhooks import DELIVERIES


@pytest.fixture
def client(broker_url: str) -> redis.Redis:
    client = client_of(broker_url)
    client.flushall()
    return client


@pytest.fixture
def records(client: redis.Redis) -> JobRecords:
    return JobRecords(client)


@pytest.fixture
def sweeper(client: redis.Redis) -> Sweeper:
    return Sweeper(client, 3600)


def waiting(records: JobRecords, name: str, seconds: float) -> None:
    """Record a job that has waited for so long."""
    job = Job(id=name, owner="me", status="queued", created_at=time.time() - seconds)
    assert records.run(create(job, most_jobs=0, most_bytes=0)) == 1


def send(broker_url: str, *names: str) -> None:
    queue = create_celery(Settings(broker_url=broker_url))
    for name in names:
        queue.send_task(VECTORIZE, [name])
    queue.close()


@pytest.fixture
def queue(broker_url: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Have the sweeper send its messages to the tests' broker."""
    celery = create_celery(Settings(broker_url=broker_url))
    monkeypatch.setattr(sweeping, "app", celery)
    yield
    celery.close()


@pytest.mark.usefixtures("queue")
@pytest.mark.parametrize(
    ("schedule", "name"), [(EXPIRY, SHORT_QUEUE), (DELIVERIES, HOOKS_QUEUE)], ids=["removals", "webhooks"]
)
def test_nothing_is_sent_again_and_again_while_nobody_takes_it(
    client: redis.Redis, sweeper: Sweeper, schedule: str, name: str
) -> None:
    entries = [f"{number} succeeded" for number in range(300)]
    for _ in range(5):
        client.zadd(schedule, dict.fromkeys(entries, time.time() - 1))
        sweeper.sweep()
    assert client.llen(name) <= 201  # and one to tidy up


def test_a_job_without_a_message_is_lost_after_a_while(records: JobRecords, sweeper: Sweeper) -> None:
    waiting(records, "old", 60)
    waiting(records, "new", 1)
    assert sweeper.lost() == ["old"]


def test_a_job_is_lost_when_later_ones_are_next(
    broker_url: str, records: JobRecords, sweeper: Sweeper
) -> None:
    """A queue that is never empty hides none."""
    waiting(records, "lost", 60)
    waiting(records, "next", 40)
    waiting(records, "last", 20)
    send(broker_url, "next", "last")
    assert sweeper.lost() == ["lost"]


def test_jobs_that_wait_for_their_turn_are_not_lost(
    broker_url: str, records: JobRecords, sweeper: Sweeper
) -> None:
    for name, seconds in (("first", 60), ("second", 40)):
        waiting(records, name, seconds)
    send(broker_url, "first", "second")
    assert sweeper.lost() == []
    records.run(finish("first", "canceled", retention=60))
    assert sweeper.lost() == []


def test_a_running_job_is_lost_with_its_lease(
    client: redis.Redis, broker_url: str, records: JobRecords, sweeper: Sweeper
) -> None:
    waiting(records, "running", 60)
    waiting(records, "waiting", 5)
    send(broker_url, "waiting")
    assert records.run(claim("running")) == 1
    assert sweeper.lost() == []
    client.delete(lease_key("running"))
    assert sweeper.lost() == ["running"]
    assert client.llen(JOBS_QUEUE) == 1


def test_a_full_broker_gets_room_from_what_has_expired(
    client: redis.Redis, sweeper: Sweeper, records: JobRecords
) -> None:
    for name, retention in (("expired", -1), ("kept", 60)):
        waiting(records, name, 1)
        assert records.run(claim(name)) == 1
        assert records.run(finish(name, "failed", retention=retention)) == 1
    client.config_set("maxmemory", 1)
    try:
        with pytest.raises(redis.OutOfMemoryError):
            client.set("gcvec:sweeper", "1")
        sweeper.make_room()
    finally:
        client.config_set("maxmemory", 0)
    assert client.keys("gcvec:events:*") == [events_key("kept")]
    assert records.get("expired") is not None  # to be removed with its files


def test_a_message_that_is_not_ours_holds_nothing_up(
    sweeper: Sweeper, records: JobRecords, client: redis.Redis
) -> None:
    for strange in ("no JSON", '{"body": "bm9uZQ=="}', '{"body": "W1tdLCB7fSwge31d"}', "{}"):
        client.flushall()
        waiting(records, "waits", 60)
        client.rpush(JOBS_QUEUE, strange)
        assert sweeper.lost() == []
