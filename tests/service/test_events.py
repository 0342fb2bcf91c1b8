from __future__ import annotations

import json
import threading
import time
from typing import Any

import httpx

from tests.service.conftest import Jobs
from worker.records import claim, finish, report


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
            jobs.records.run(report(job_id, 1, [iteration(number)]))
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
    jobs.records.run(report(job_id, 1, [iteration(number) for number in range(1, 6)]))
    jobs.records.run(finish(job_id, "failed", retention=60))
    path = f"/v1/jobs/{job_id}/events"
    seen = events(api.get(path, headers={"Last-Event-ID": "3"}))
    assert [event.get("id") for event in seen] == [None, "4", "5", "6"]
    assert api.get(path, headers={"Last-Event-ID": "6"}).status_code == 204
    assert api.get(path, headers={"Last-Event-ID": "x"}).status_code == 422


def test_a_stream_of_many_events_is_whole(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    jobs.records.run(claim(job_id))
    jobs.records.run(report(job_id, 1, [iteration(number) for number in range(1, 1501)]))
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
