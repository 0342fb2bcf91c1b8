"""Broker, API or the whole service die and come back."""

from __future__ import annotations

import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import httpx
import pytest

from tests.fleet import ENDLESS, LONG, ON_EVERY_SERVER, SHORT, Fleet, one_region, picture
from tests.running_service import start_service
from tests.waiting import within

pytestmark = [pytest.mark.service, pytest.mark.slow]


@ON_EVERY_SERVER
@pytest.mark.parametrize("how", ["killed", "stopped"])
def test_the_broker_may_be_restarted(start_fleet: Callable[..., Fleet], server: Path, how: str) -> None:
    fleet = start_fleet(server)
    api, worker = fleet.start_api(), fleet.start_worker()
    running, queued = api.submit(**LONG), api.submit(**SHORT)
    within(20, lambda: fleet.refining(running))
    if how == "killed":
        fleet.broker.kill()
    else:
        assert fleet.broker.ask_to_stop() == 0
    time.sleep(1)
    fleet.start_broker()
    within(20, api.ready)
    for job_id in (running, queued):
        assert api.outcome(job_id)["status"] == "succeeded"
        assert fleet.ends_of(job_id) == ["succeeded"]
        assert fleet.job(job_id).attempt == 1
    assert worker.alive
    assert api.outcome(api.submit(**SHORT))["status"] == "succeeded"


@ON_EVERY_SERVER
def test_without_a_broker_nothing_is_accepted_and_nothing_is_left(
    start_fleet: Callable[..., Fleet], server: Path
) -> None:
    fleet = start_fleet(server)
    api = fleet.start_api()
    fleet.broker.kill()
    answers = [api.post(**SHORT), api.http.get("/v1/jobs"), api.http.get("/readyz")]
    for answer in answers:
        assert answer.status_code == 503
        assert answer.headers["content-type"] == "application/problem+json"
        assert int(answer.headers["retry-after"]) > 0
    assert api.http.get("/livez").status_code == 200
    assert fleet.files() == []
    fleet.start_broker()
    within(20, api.ready)
    assert api.http.get("/v1/jobs").json()["jobs"] == []
    assert fleet.client.keys("gcvec:*job*") == []
    assert fleet.client.llen("gcvec-jobs") == 0


@ON_EVERY_SERVER
def test_with_a_full_broker_jobs_end_and_can_be_looked_at_and_deleted(
    start_fleet: Callable[..., Fleet], server: Path
) -> None:
    fleet = start_fleet(server)
    api, worker = fleet.start_api(), fleet.start_worker()
    ended, running, unwanted = api.submit(**SHORT), api.submit(**LONG), api.submit(**ENDLESS)
    assert api.outcome(ended)["status"] == "succeeded"
    within(20, lambda: fleet.refining(running))
    fleet.client.config_set("maxmemory", 1)
    assert api.http.get("/v1/jobs").status_code == 200
    assert api.http.get("/metrics").status_code == 200
    assert api.http.get(f"/v1/jobs/{ended}/result.gcv").status_code == 200
    refused = api.post(**SHORT)
    assert (refused.status_code, refused.headers["retry-after"]) == (503, "5")
    assert len({path.split("/")[1] for path in fleet.files()}) == 3
    assert api.http.delete(f"/v1/jobs/{ended}").status_code == 204
    assert api.http.get(f"/v1/jobs/{ended}").status_code == 410
    assert api.http.delete(f"/v1/jobs/{unwanted}").status_code == 204
    assert api.outcome(running, 90)["status"] == "succeeded"
    fleet.client.config_set("maxmemory", 0)
    worker.kill()  # Celery's has ended by itself, or may yet, where it could not acknowledge a message
    fleet.start_worker()
    assert api.outcome(api.submit(**SHORT))["status"] == "succeeded"
    assert [fleet.job(job_id).attempt for job_id in (running, unwanted)] == [1, 0]


def test_events_go_on_where_they_were_after_the_api_was_killed(fleet: Fleet) -> None:
    api = fleet.start_api()
    fleet.start_worker()
    job_id = api.submit(**LONG)
    seen: list[tuple[int, str]] = []

    def listen() -> None:
        for event in api.events(job_id):
            seen.append(event)

    listener = threading.Thread(target=listen)
    listener.start()
    within(20, lambda: len(seen) > 20)
    api.process.kill()
    listener.join(10)
    before = len(seen)
    assert seen[-1][1] == "progress"
    again = fleet.start_api(api.port)
    seen += again.events(job_id, after=seen[-1][0])
    assert len(seen) > before
    assert [number for number, _ in seen] == list(range(1, len(seen) + 1))
    assert [kind for _, kind in seen] == ["progress"] * (len(seen) - 1) + ["state"]
    assert again.outcome(job_id)["status"] == "succeeded"


def test_an_api_that_is_killed_while_it_takes_jobs_has_taken_them_or_not(fleet: Fleet) -> None:
    api = fleet.start_api()
    taken: list[str] = []

    def submit(seed: int) -> None:
        with suppress(httpx.TransportError):
            taken.append(api.submit(24, seed, **SHORT))

    with ThreadPoolExecutor(16) as clients:
        ends = clients.map(submit, range(64))
        within(20, lambda: len(taken) > 8)
        api.process.kill()
    assert list(ends) == [None] * 64
    assert 8 < len(taken) < 64
    again = fleet.start_api(api.port)
    fleet.start_worker(concurrency=2)
    within(60, lambda: fleet.client.zcard("gcvec:active") == 0)
    known = set(fleet.client.zrange("gcvec:jobs:anyone", 0, -1))
    assert set(taken) <= known
    for job_id in known:
        assert again.outcome(job_id)["status"] == "succeeded"
        assert fleet.ends_of(job_id) == ["succeeded"]
    for path in fleet.files():  # what is not a job's is an upload that was never taken
        assert path.split("/")[1] in known or path.split("/")[2] == "input"


@ON_EVERY_SERVER
def test_a_killed_service_goes_on_with_its_folder(tmp_path: Path, server: Path) -> None:
    path = {"PATH": str(server.parent)}  # where it looks for a broker before it takes the package's
    service = start_service(tmp_path / "data", "--workers", "1", **path)
    files = {"image": ("a.png", picture()), "annotations": ("a.xml", one_region(48))}
    with httpx.Client(base_url=service.url, timeout=40) as http:
        form = {"options": '{"target_mse": 60}'}
        ids = [http.post("/v1/jobs", files=files, data=form).json()["id"] for _ in range(4)]
        while http.get(f"/v1/jobs/{ids[0]}?wait=30").json()["status"] != "succeeded":
            pass
        result = http.get(f"/v1/jobs/{ids[0]}/result.gcv").content
        ids += [http.post("/v1/jobs", files=files, data=form).json()["id"] for _ in range(2)]
    service.stop(signal.SIGKILL)
    service = start_service(tmp_path / "data", "--workers", "1", **path)
    try:
        with httpx.Client(base_url=service.url, timeout=40) as http:
            assert http.get(f"/v1/jobs/{ids[0]}/result.gcv").content == result
            for job_id in ids:
                deadline = time.monotonic() + 40
                while (job := http.get(f"/v1/jobs/{job_id}?wait=10").json())["status"] != "succeeded":
                    assert time.monotonic() < deadline, job
    finally:
        assert service.stop() == 0
