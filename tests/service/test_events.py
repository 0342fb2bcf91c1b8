from __future__ import annotations

import json
import threading
import time
from collections.abc import AsyncIterator
from typing import Any, NoReturn

import httpx
import pytest
from redis.exceptions import RedisError

from service.deps import Services
from service.jobs import service
from service.jobs.repository import JobRepository
from tests.broker import client_of
from tests.service.in_process import Jobs, serving
from worker.job import Job
from worker.problems import problem
from worker.settings import Settings
from worker.steps import claim, finish, record_key, report


def parsed(text: str) -> list[dict[str, Any]]:
    events = []
    for block in text.strip().split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.splitlines() if not line.startswith(":"))
        if "data" in fields:
            events.append({**fields, "data": json.loads(fields["data"])})
    return events


def events(answer: httpx.Response) -> list[dict[str, Any]]:
    assert answer.headers["content-type"].startswith("text/event-stream")
    return parsed(answer.text)


def iteration(number: int) -> dict[str, Any]:
    return {
        "phase": "refine",
        "region": 1,
        "regions": 4,
        "iteration": number,
        "points": 30,
        "worst_error": 8.0,
        "mse": 9.5,
        "fraction": 0.4,
    }


def test_a_snapshot_then_every_iteration_then_the_end(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()

    def work() -> None:
        time.sleep(0.3)
        jobs.records.run(claim(job_id))
        for number in range(1, 6):
            jobs.records.run(report(job_id, 1, [iteration(number)], number))
            time.sleep(0.05)
        jobs.records.run(finish(job_id, "succeeded", retention=60))

    threading.Thread(target=work).start()
    first, *middle, last = events(api.get(f"/v1/jobs/{job_id}/events"))
    assert first["event"] == "snapshot"
    assert "id" not in first
    assert first["data"]["status"] == "queued"
    assert [event["event"] for event in middle] == ["progress"] * 5
    assert [event["data"] for event in middle] == [iteration(number) for number in range(1, 6)]
    assert last["event"] == "state"
    assert last["data"]["status"] == "succeeded"
    assert "result" in last["data"]["links"]
    assert [int(event["id"]) for event in (*middle, last)] == [1, 2, 3, 4, 5, 6]


def test_a_listener_that_comes_back_gets_what_it_missed(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    jobs.records.run(claim(job_id))
    jobs.records.run(report(job_id, 1, [iteration(number) for number in range(1, 6)], 1))
    jobs.records.run(finish(job_id, "failed", retention=60))
    path = f"/v1/jobs/{job_id}/events"
    seen = events(api.get(path, headers={"Last-Event-ID": "3"}))
    assert [event.get("id") for event in seen] == [None, "4", "5", "6"]
    assert api.get(path, headers={"Last-Event-ID": "6"}).status_code == 204
    for unlikely in ("x", "-1", "1" + 30 * "0"):
        assert api.get(path, headers={"Last-Event-ID": unlikely}).status_code == 422


def test_a_stream_of_many_events_is_whole(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    jobs.records.run(claim(job_id))
    jobs.records.run(report(job_id, 1, [iteration(number) for number in range(1, 1501)], 1))
    jobs.records.run(finish(job_id, "succeeded", retention=60))
    seen = events(api.get(f"/v1/jobs/{job_id}/events"))
    assert [event["data"]["iteration"] for event in seen[1:-1]] == list(range(1, 1501))


def test_deleting_a_job_ends_its_stream(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    deletion = threading.Timer(0.5, lambda: api.delete(f"/v1/jobs/{job_id}"))
    deletion.start()
    *_, last = events(api.get(f"/v1/jobs/{job_id}/events"))
    deletion.join()
    assert last["data"]["status"] == "canceled"


def test_the_last_event_is_the_whole_job_whenever_it_ends(
    api: httpx.Client, jobs: Jobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Here after the stream has been asked for, before it listens; the second job expires at once."""
    stream, reason = service.stream, problem("time-limit", "too long")
    retention = 60.0

    def just_ended(services: Services, job: Job, after: int) -> AsyncIterator[bytes]:
        jobs.records.run(finish(job.id, "failed", retention=retention, error=reason, warnings=("careful",)))
        return stream(services, job, after)

    monkeypatch.setattr(service, "stream", just_ended)
    job_id = jobs.submit()
    first, last = events(api.get(f"/v1/jobs/{job_id}/events"))
    assert (first["data"]["status"], last["event"]) == ("queued", "state")
    assert last["data"] == api.get(f"/v1/jobs/{job_id}").json()
    assert last["data"]["error"]["detail"] == "too long"
    retention = 0.0
    _, expired = events(api.get(f"/v1/jobs/{jobs.submit()}/events"))
    assert expired["data"]["status"] == "failed"
    assert expired["data"].keys() == last["data"].keys()


@pytest.mark.parametrize("ahead", [7, 2**53])
def test_who_names_an_event_that_is_yet_to_come_gets_the_end_all_the_same(
    api: httpx.Client, jobs: Jobs, ahead: int
) -> None:
    job_id = jobs.submit()
    jobs.records.run(claim(job_id))
    jobs.records.run(report(job_id, 1, [iteration(1), iteration(2)], 1))
    end = threading.Timer(0.5, lambda: jobs.records.run(finish(job_id, "succeeded", retention=60)))
    end.start()
    headers = {"Last-Event-ID": str(ahead)}
    seen = events(api.get(f"/v1/jobs/{job_id}/events", headers=headers, timeout=5))
    end.join()
    assert [event.get("id") for event in seen] == [None, "3"]


def test_a_stream_ends_with_its_job_even_if_no_event_says_so(
    api: httpx.Client, jobs: Jobs, settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As when the server of the records was started again without its last second."""
    monkeypatch.setattr("service.jobs.service._PING_SECONDS", 0.3)
    job_id = jobs.submit()
    record = record_key(job_id)
    end = threading.Timer(0.5, lambda: client_of(settings.broker_url).hset(record, "status", "failed"))
    end.start()
    (only,) = events(api.get(f"/v1/jobs/{job_id}/events", timeout=5))
    end.join()
    assert only["event"] == "snapshot"


def test_an_outage_ends_streams_and_is_told_of_once(
    settings: Settings, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    async def away(*_: Any) -> NoReturn:
        raise RedisError

    monkeypatch.setattr("service.jobs.repository._RECONNECT_SECONDS", 0.1)
    with caplog.at_level("INFO"), serving(settings) as client:
        job_id = Jobs(client, settings).submit()
        monkeypatch.setattr(JobRepository, "events", away)
        (only,) = events(client.get(f"/v1/jobs/{job_id}/events"))
        assert only["event"] == "snapshot"
        connections = [entry["id"] for entry in client_of(settings.broker_url).client_list(_type="pubsub")]
        monkeypatch.setattr("redis.asyncio.client.PubSub.subscribe", away)
        for connection in connections:
            client_of(settings.broker_url).client_kill_filter(_id=connection)
        time.sleep(1)
    assert len([text for text in caplog.messages if text.startswith("changes are not heard")]) == 1
    assert not [record for record in caplog.records if record.exc_info]
