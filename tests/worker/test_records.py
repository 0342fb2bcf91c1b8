from __future__ import annotations

import json
import time
import uuid

import pytest
import redis

from tests.broker import client_of
from worker.job import Job
from worker.problems import problem
from worker.questions import Answer
from worker.records import JobRecords
from worker.steps import (
    ACTIVE,
    EXPIRY,
    STORED,
    TOTALS,
    claim,
    create,
    events_key,
    finish,
    grow,
    lease_key,
    owner_key,
    record_key,
    report,
    requeue,
    retire,
)
from worker.storage import Manifest, StoredFile


@pytest.fixture
def client(broker_url: str) -> redis.Redis:
    return client_of(broker_url)


@pytest.fixture
def records(client: redis.Redis) -> JobRecords:
    return JobRecords(client)


@pytest.fixture
def job(client: redis.Redis) -> Job:
    job = Job(
        id=uuid.uuid4().hex,
        owner="me",
        status="queued",
        created_at=time.time(),
        request={"options": {"a": [1]}},
    )
    client.hset(record_key(job.id), mapping=job.to_fields())
    client.zadd(ACTIVE, {job.id: job.created_at})
    client.zadd(owner_key(job.owner), {job.id: job.created_at})
    return job


def test_a_record_is_read_as_it_was_written(records: JobRecords, job: Job) -> None:
    assert records.get(job.id) == job


def test_what_a_newer_version_adds_is_passed_over(records: JobRecords, client: redis.Redis, job: Job) -> None:
    client.hset(record_key(job.id), "mood", "not even JSON")
    assert records.get(job.id) == job
    file = {"path": "a", "size": 1, "sha256": "b"}
    manifest = {"attempt": 1, "files": {"gcv": {**file, "color": 1}}, "warnings": [], "totals": {}, "more": 2}
    assert Manifest.from_json(json.dumps(manifest).encode()).files == {"gcv": StoredFile(**file)}
    trouble = {**problem("gone", "away").as_dict(), "advice": "none"}
    assert Answer.from_json(json.dumps({"value": None, "problem": trouble})).problem == problem(
        "gone", "away"
    )


def test_an_unknown_job_cannot_be_claimed(records: JobRecords, client: redis.Redis) -> None:
    assert records.run(claim("none")) == 0
    assert records.get("none") is None
    assert not client.exists(record_key("none"))


def test_only_one_of_two_workers_gets_a_job(records: JobRecords, job: Job) -> None:
    assert records.run(claim(job.id)) == 1
    assert records.run(claim(job.id)) == 0
    now = records.get(job.id)
    assert now is not None
    assert (now.status, now.attempt) == ("running", 1)


def test_a_job_whose_lease_has_lapsed_starts_a_new_attempt(
    records: JobRecords, client: redis.Redis, job: Job
) -> None:
    records.run(claim(job.id))
    first_start = records.get(job.id)
    client.delete(lease_key(job.id))
    assert records.run(claim(job.id)) == 2
    second_start = records.get(job.id)
    assert first_start is not None
    assert second_start is not None
    assert second_start.started_at == first_start.started_at


def test_events_are_numbered_through_all_attempts(records: JobRecords, client: redis.Redis, job: Job) -> None:
    records.run(claim(job.id))
    assert records.run(report(job.id, 1, [{"n": 1}, {"n": 2}], 1))
    client.delete(lease_key(job.id))
    records.run(claim(job.id))
    assert records.run(report(job.id, 2, [{"n": 3}], 1))
    records.run(finish(job.id, "succeeded", retention=60))
    entries = client.xrange(events_key(job.id))
    assert [key for key, _ in entries] == ["1-0", "2-0", "3-0", "4-0"]
    assert [entry["type"] for _, entry in entries] == ["progress"] * 3 + ["state"]
    now = records.get(job.id)
    assert now is not None
    assert now.progress == {"n": 3}


def test_events_whose_report_was_not_answered_are_appended_once(
    records: JobRecords, client: redis.Redis, job: Job
) -> None:
    def told() -> list[int]:
        return [json.loads(entry["data"])["n"] for _, entry in client.xrange(events_key(job.id))]

    for attempt in (1, 2):
        assert records.run(claim(job.id)) == attempt
        step = report(job.id, attempt, [{"n": 1}, {"n": 2}], 1)
        assert [records.run(step) for _ in range(2)] == [1, 1]
        assert records.run(report(job.id, attempt, [{"n": 1}, {"n": 2}, {"n": 3}], 1))
        assert records.run(report(job.id, attempt, [{"n": 6}], 6))  # others had to make room
        assert records.run(report(job.id, attempt, [], 7))
        assert told() == [1, 2, 3, 6] * attempt
        client.delete(lease_key(job.id))


def test_an_older_attempt_can_change_nothing(records: JobRecords, client: redis.Redis, job: Job) -> None:
    records.run(claim(job.id))
    client.delete(lease_key(job.id))
    records.run(claim(job.id))
    before = client.hgetall(record_key(job.id))
    assert records.run(report(job.id, 1, [{"n": 1}], 1)) == 0
    assert records.run(finish(job.id, "failed", attempt=1, retention=60)) == 0
    assert client.hgetall(record_key(job.id)) == before
    assert client.get(lease_key(job.id)) == "2"


def test_a_job_ends_once(records: JobRecords, client: redis.Redis, job: Job) -> None:
    error = problem("time-limit", "too long")
    assert records.run(finish(job.id, "failed", error=error, retention=60)) == 1
    for status in ("succeeded", "canceled", "failed"):
        assert records.run(finish(job.id, status, retention=60)) == 0
    assert records.run(claim(job.id)) == 0
    now = records.get(job.id)
    assert now is not None
    assert now.status == "failed"
    assert now.error == error.as_dict()
    assert now.expires_at is not None
    assert now.finished_at is not None
    assert now.expires_at - now.finished_at == pytest.approx(60)
    assert client.zscore(ACTIVE, job.id) is None
    assert client.zscore(EXPIRY, job.id) == pytest.approx(now.expires_at)


def test_a_running_job_waits_again_only_when_nobody_runs_it(
    records: JobRecords, client: redis.Redis, job: Job
) -> None:
    records.run(claim(job.id))
    assert records.run(requeue(job.id)) == 0
    client.delete(lease_key(job.id))
    assert records.run(requeue(job.id)) == 1
    now = records.get(job.id)
    assert now is not None
    assert now.status == "queued"


def test_what_is_left_of_a_retired_job_is_its_owner(
    records: JobRecords, client: redis.Redis, job: Job
) -> None:
    records.run(claim(job.id))
    records.run(report(job.id, 1, [{"n": 1}], 1))
    records.run(retire(job.id))
    assert client.hgetall(record_key(job.id)) == {"owner": "me"}
    assert client.ttl(record_key(job.id)) > 0
    assert records.get(job.id) is None
    assert not client.exists(events_key(job.id), lease_key(job.id))
    assert client.zscore(ACTIVE, job.id) is None
    assert client.zscore(owner_key("me"), job.id) is None
    assert records.run(report(job.id, 1, [{"n": 2}], 2)) == 0


def test_a_job_that_nothing_is_known_of_is_not_taken_for_deleted(records: JobRecords, job: Job) -> None:
    assert not records.unwanted(job.id)
    assert not records.unwanted("none")
    records.run(finish(job.id, "canceled", retention=60))
    assert records.unwanted(job.id)
    records.run(retire(job.id))
    assert records.unwanted(job.id)


def test_a_step_whose_answer_was_lost_counts_once(records: JobRecords, client: redis.Redis) -> None:
    name, owner = uuid.uuid4().hex, uuid.uuid4().hex
    job = Job(id=name, owner=owner, status="queued", created_at=time.time(), bytes=1000)
    for _ in range(2):
        assert records.run(create(job, most_jobs=1, most_bytes=0)) == 1
    assert client.hget(STORED, owner) == "1000"
    records.run(claim(name))
    records.run(finish(name, "succeeded", retention=60))
    for _ in range(2):
        assert records.run(grow(name, 500, "0/preview@2x.png")) == 1
    assert client.hget(STORED, owner) == "1500"
    records.run(retire(name))
    assert client.hget(STORED, owner) == "0"


def test_a_claim_whose_answer_was_lost_is_the_same(records: JobRecords, job: Job) -> None:
    """The client library runs a step again then."""
    step = claim(job.id)
    assert [records.run(step) for _ in range(2)] == [1, 1]
    assert records.run(claim(job.id)) == 0


def test_an_end_whose_answer_was_lost_is_the_same(records: JobRecords, client: redis.Redis, job: Job) -> None:
    step = finish(job.id, "succeeded", retention=60, totals={"points": 3})
    assert records.run(step) == 1
    after = client.hgetall(record_key(job.id)), client.hgetall(TOTALS), client.xlen(events_key(job.id))
    assert records.run(step) == 1
    assert records.run(finish(job.id, "succeeded", retention=60)) == 0
    assert after == (
        client.hgetall(record_key(job.id)),
        client.hgetall(TOTALS),
        client.xlen(events_key(job.id)),
    )
    records.run(retire(job.id))
    assert records.run(step) == 0
