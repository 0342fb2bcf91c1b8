from __future__ import annotations

import asyncio
import threading
import time
from pathlib import Path

import httpx
import pytest

from service.app import create_app
from service.jobs.service import delete
from tests.problems import refused
from tests.service.in_process import Jobs
from tests.uploads import png
from worker.problems import problem
from worker.settings import Settings
from worker.steps import claim, finish, report


def test_an_unknown_job_is_not_found(api: httpx.Client) -> None:
    for method, path in (("GET", ""), ("GET", "/events"), ("GET", "/result"), ("DELETE", "")):
        answer = api.request(method, f"/v1/jobs/{'0' * 32}{path}")
        assert answer.status_code == 404
        assert answer.json()["type"] == "urn:gcvec:problem:not-found"


def test_a_job_tells_its_progress_and_its_end(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    jobs.records.run(claim(job_id))
    progress = {
        "phase": "refine",
        "region": 1,
        "regions": 4,
        "iteration": 2,
        "points": 30,
        "worst_error": 8.0,
        "mse": 9.5,
        "fraction": 0.4,
    }
    jobs.records.run(report(job_id, 1, [progress], 1))
    running = api.get(f"/v1/jobs/{job_id}").json()
    assert running["status"] == "running"
    assert running["progress"] == progress
    error = problem("unknown-image", "no such image", "image 'b'")
    jobs.records.run(finish(job_id, "failed", error=error, retention=60))
    failed = api.get(f"/v1/jobs/{job_id}").json()
    assert failed["status"] == "failed"
    assert failed["error"] == error.as_dict()
    assert failed["created_at"] <= failed["started_at"] <= failed["finished_at"] < failed["expires_at"]
    assert set(failed["links"]) == {"self", "events", "image"}


def test_a_long_poll_answers_when_the_job_ends(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    threading.Timer(0.5, lambda: jobs.records.run(finish(job_id, "canceled", retention=60))).start()
    started = time.monotonic()
    answer = api.get(f"/v1/jobs/{job_id}?wait=20").json()
    assert answer["status"] == "canceled"
    assert 0.3 < time.monotonic() - started < 20


def test_a_long_poll_answers_after_its_time(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    started = time.monotonic()
    assert api.get(f"/v1/jobs/{job_id}?wait=0.3").json()["status"] == "queued"
    assert time.monotonic() - started >= 0.3
    assert api.get(f"/v1/jobs/{job_id}?wait=31").status_code == 422


def test_deleting_a_queued_job_cancels_it(api: httpx.Client, jobs: Jobs, tmp_path: Path) -> None:
    job_id = jobs.submit()
    assert api.delete(f"/v1/jobs/{job_id}").status_code == 204
    assert api.get(f"/v1/jobs/{job_id}").json()["status"] == "canceled"
    assert api.get(f"/v1/jobs/{job_id}/result").status_code == 409
    assert not (tmp_path / "storage/jobs" / job_id).exists()
    assert jobs.records.run(claim(job_id)) == 0


def test_deleting_a_canceled_job_removes_it(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    for _ in range(2):
        answer = api.delete(f"/v1/jobs/{job_id}")
        assert (answer.status_code, answer.content) == (204, b"")
        assert "content-type" not in answer.headers
    refused(api.get(f"/v1/jobs/{job_id}"), 410, "gone")
    refused(api.delete(f"/v1/jobs/{job_id}"), 410, "gone")
    assert api.get("/v1/jobs").json()["jobs"] == []


def test_of_two_who_cancel_at_a_time_none_removes(api: httpx.Client, jobs: Jobs, settings: Settings) -> None:
    job_id = jobs.submit()
    as_both_saw_it = jobs.records.get(job_id)
    assert as_both_saw_it is not None

    async def cancel_twice() -> None:
        app = create_app(settings)
        async with app.router.lifespan_context(app):
            await delete(app.state.services, as_both_saw_it)
            await delete(app.state.services, as_both_saw_it)

    asyncio.run(cancel_twice())
    assert api.get(f"/v1/jobs/{job_id}").json()["status"] == "canceled"


def test_deleting_a_finished_job_removes_it(api: httpx.Client, jobs: Jobs, tmp_path: Path) -> None:
    job_id = jobs.finished()
    assert api.delete(f"/v1/jobs/{job_id}").status_code == 204
    for path in ("", "/events", "/result", "/preview.png"):
        answer = api.get(f"/v1/jobs/{job_id}{path}")
        assert answer.status_code == 410
        assert answer.json()["type"] == "urn:gcvec:problem:gone"
    assert not (tmp_path / "storage/jobs" / job_id).exists()
    assert api.get("/v1/jobs").json()["jobs"] == []


def test_an_expired_job_is_gone_before_it_is_swept(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    jobs.records.run(finish(job_id, "succeeded", retention=0))
    assert api.get(f"/v1/jobs/{job_id}").status_code == 410


def test_an_expired_job_is_listed_no_more(api: httpx.Client, jobs: Jobs) -> None:
    oldest, expired, newest = (jobs.submit() for _ in range(3))
    jobs.records.run(finish(expired, "succeeded", retention=0))
    page = api.get("/v1/jobs?limit=2").json()
    assert [job["id"] for job in page["jobs"]] == [newest, oldest]
    assert page["next"] is None


def test_jobs_are_listed_newest_first_page_by_page(api: httpx.Client, jobs: Jobs) -> None:
    ids = [jobs.submit() for _ in range(5)]
    seen: list[str] = []
    link = "/v1/jobs?limit=2"
    while link:
        page = api.get(link).json()
        assert len(page["jobs"]) <= 2
        seen += [job["id"] for job in page["jobs"]]
        link = page["next"]
    assert seen == ids[::-1]
    for cursor in ("x", "00", "5b5d", "7b7d", "5b312c327d", b'[NaN,"x"]'.hex(), b'[1e999,"x"]'.hex()):
        assert api.get(f"/v1/jobs?cursor={cursor}").status_code == 422


@pytest.mark.parametrize(
    ("method", "path", "allowed"),
    [
        ("GET", "/v1/jobs/x/edits", "POST"),
        ("PUT", "/v1/jobs", "GET, POST"),
        ("OPTIONS", "/v1/jobs", "GET, POST"),
        ("POST", "/v1/jobs/x", "DELETE, GET, HEAD"),
        ("DELETE", "/v1/jobs/x/revisions/1/result.gcv", "GET, HEAD"),
        ("POST", "/app.js", "GET, HEAD"),
        ("POST", "/docs", "GET, HEAD"),
    ],
)
def test_a_method_that_an_address_does_not_know_is_refused(
    api: httpx.Client, method: str, path: str, allowed: str
) -> None:
    answer = api.request(method, path)
    refused(answer, 405, "method-not-allowed")
    assert answer.headers["allow"] == allowed


def test_an_address_with_a_slash_too_many_is_another_one(api: httpx.Client) -> None:
    for path in ("/v1/jobs/", "/v1/jobs/x/result/", "/docs/"):
        refused(api.get(path), 404, "not-found")


def test_the_picture_is_linked_to_as_long_as_it_is_there(api: httpx.Client, jobs: Jobs) -> None:
    address = f"/v1/jobs/{jobs.submit()}"
    assert api.get(api.get(address).json()["links"]["image"]).content == png()
    api.delete(address)
    canceled = api.get(address).json()
    assert canceled["status"] == "canceled"
    assert "image" not in canceled["links"]
