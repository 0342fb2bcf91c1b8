"""Pictures that are shared out over workers, which die, are late, or are not there."""

from __future__ import annotations

import json
import os
import re
import signal
import time
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest

from tests.fleet import SHORT, Api, Fleet, Process, picture
from tests.waiting import within
from worker.app import create_celery
from worker.claims import NOTHING, claim_part, end_part, holders_key, open_round, parts_key, renew_part
from worker.job import Job
from worker.queues import ASSIST, JOBS_QUEUE, PARTS_QUEUE, VECTORIZE
from worker.settings import Settings
from worker.steps import claim, create

pytestmark = [pytest.mark.service, pytest.mark.slow]

SHARED = {"GCVEC_FAN_OUT_MEGAPIXELS": "0.01", "GCVEC_FAN_OUT_PARTS": "4"}
OPTIONS = {"target_mse": 4, "max_points": 0, "effort": 7}


def tiles(side: int, n: int) -> bytes:
    """CVAT annotations that cut a square picture into n times n regions."""
    cuts = [side * k // n for k in range(n + 1)]
    polygons = [
        f'<polygon label="tile" points="{x},{y};{x2},{y};{x2},{y2};{x},{y2}" z_order="0"></polygon>'
        for x, x2 in pairwise(cuts)
        for y, y2 in pairwise(cuts)
    ]
    image = f'<image id="0" name="a.png" width="{side}" height="{side}">{"".join(polygons)}</image>'
    return f"<annotations><version>1.1</version>{image}</annotations>".encode()


SIDE = 420
LARGE = picture(SIDE), tiles(SIDE, 6)


def submit(api: Api, **options: Any) -> str:
    files = {"image": ("a.png", LARGE[0]), "annotations": ("a.xml", LARGE[1])}
    answer = api.http.post("/v1/jobs", files=files, data={"options": json.dumps(OPTIONS | options)})
    assert answer.status_code == 202, answer.text
    job_id: str = answer.json()["id"]
    return job_id


def send(fleet: Fleet, *tasks: tuple[str, list[Any]]) -> None:
    queue = create_celery(Settings(broker_url=fleet.broker_url))
    for name, arguments in tasks:
        queue.send_task(name, arguments)
    queue.close()


def assistance(*workers: Process) -> int:
    """How many parts these workers have done for others."""
    return sum(len(re.findall(r"part \d+ done for attempt", worker.log.read_text())) for worker in workers)


def busy(fleet: Fleet, worker: Process, attempt: int = 1) -> bool:
    """Whether the worker is in the midst of a part for another."""
    return f"assists attempt {attempt}" in worker.log.read_text().rpartition(" done for attempt")[2]


def begun_with_a_helper(shared: Fleet) -> tuple[Api, str, Process]:
    """A job that one of two workers has begun, and the other, which works on a part of it."""
    api = shared.start_api()
    workers = [shared.start_worker() for _ in range(2)]
    job_id = submit(api)
    within(30, lambda: any(busy(shared, worker) for worker in workers))
    (helper,) = [worker for worker in workers if busy(shared, worker)]
    return api, job_id, helper


def in_charge(workers: list[Process], job_id: str) -> Process:
    (worker,) = [w for w in workers if f"job {job_id}: attempt 1" in w.log.read_text()]
    return worker


def assert_done_once(fleet: Fleet, api: Api, job_id: str, attempt: int) -> None:
    manifest = fleet.manifest(job_id)
    assert manifest is not None
    assert manifest.attempt == fleet.job(job_id).attempt == attempt
    assert fleet.ends_of(job_id) == ["succeeded"]
    assert_nothing_left(fleet, job_id)
    report = api.http.get(f"/v1/jobs/{job_id}/report").json()
    assert report["mse"] <= OPTIONS["target_mse"]
    assert report["foldovers"] == 0
    assert report["seconds"]["parts"] > 0


def assert_nothing_left(fleet: Fleet, job_id: str) -> None:
    """No file of a part, and no claim but those that are forgotten in time."""
    within(10, lambda: [path for path in fleet.files(job_id) if "/round-" in path] == [])
    job = fleet.records.get(job_id)
    current = job.attempt if job else 1
    for key in fleet.client.keys("gcvec:parts:*"):
        assert int(key.split(":")[3]) < current
        assert fleet.client.ttl(key) > 0


@pytest.fixture
def shared(start_fleet: Callable[..., Fleet]) -> Fleet:
    return start_fleet(**SHARED)


def test_three_workers_make_one_picture(shared: Fleet) -> None:
    """The same one that a worker makes alone."""
    api = shared.start_api()
    alone = shared.start_worker()
    first = submit(api)
    assert api.outcome(first, 120)["status"] == "succeeded"
    assert_done_once(shared, api, first, 1)
    assert assistance(alone) == 0
    within(20, lambda: shared.client.llen(PARTS_QUEUE) == 0)
    workers = [alone, shared.start_worker(), shared.start_worker()]
    second = submit(api)
    assert api.outcome(second, 120)["status"] == "succeeded"
    assert_done_once(shared, api, second, 1)
    assert assistance(*workers) >= 3
    one, other = (api.http.get(f"/v1/jobs/{job_id}/result.gcv").content for job_id in (first, second))
    assert one == other


def test_a_helper_that_is_killed_costs_nothing_but_time(shared: Fleet) -> None:
    api, job_id, helper = begun_with_a_helper(shared)
    helper.kill()
    assert api.outcome(job_id, 120)["status"] == "succeeded"
    assert_done_once(shared, api, job_id, 1)


def test_a_helper_that_sleeps_is_not_waited_for(shared: Fleet) -> None:
    api, job_id, helper = begun_with_a_helper(shared)
    (asleep,) = helper.children()
    os.kill(asleep, signal.SIGSTOP)
    assert api.outcome(job_id, 120)["status"] == "succeeded"
    os.kill(asleep, signal.SIGCONT)
    within(30, lambda: re.search("no longer assisted|not assisted", helper.log.read_text()))
    assert_done_once(shared, api, job_id, 1)


def test_a_job_whose_coordinator_is_killed_is_made_by_another_attempt(shared: Fleet) -> None:
    api = shared.start_api()
    workers = [shared.start_worker() for _ in range(3)]
    job_id = submit(api)
    within(30, lambda: any(busy(shared, worker) for worker in workers))
    in_charge(workers, job_id).kill()
    assert api.outcome(job_id, 150)["status"] == "succeeded"
    assert_done_once(shared, api, job_id, 2)
    within(10, lambda: shared.attempts_of(job_id) == {"attempt-2"})


def test_a_cancelled_job_stops_all_and_leaves_nothing(shared: Fleet) -> None:
    api = shared.start_api()
    workers = [shared.start_worker() for _ in range(2)]
    job_id = submit(api)
    within(30, lambda: any(busy(shared, worker) for worker in workers))
    assert api.http.delete(f"/v1/jobs/{job_id}").status_code == 204
    for worker in workers:
        told = "attempt 1 stopped|no longer assisted|not assisted|no longer wanted"
        within(30, lambda log=worker.log, told=told: re.search(told, log.read_text()))
    within(10, lambda: shared.files(job_id) == [])
    assert_nothing_left(shared, job_id)
    shorter = api.submit(24, **SHORT)
    assert api.outcome(shorter)["status"] == "succeeded"


def test_redis_may_go_away_and_come_back_in_mid_round(shared: Fleet) -> None:
    api = shared.start_api()
    workers = [shared.start_worker() for _ in range(2)]
    job_id = submit(api)
    within(30, lambda: any(busy(shared, worker) for worker in workers))
    shared.broker.kill()
    shared.start_broker()
    assert api.outcome(job_id, 150)["status"] == "succeeded"
    assert_nothing_left(shared, job_id)


def test_stale_invitations_do_nothing(shared: Fleet) -> None:
    worker = shared.start_worker()
    job_id = "known"
    job = Job(id=job_id, owner="me", status="queued", created_at=0)
    assert shared.records.run(create(job, most_jobs=0, most_bytes=0))
    assert shared.records.run(claim(job_id)) == 1
    shared.client.delete(f"gcvec:lease:{job_id}")
    assert shared.records.run(claim(job_id)) == 2
    open_round(shared.client, job_id, 1, 1, 4, 60)
    send(shared, *[(ASSIST, [job_id, 1, 1])] * 3, (ASSIST, ["unknown", 1, 1]))
    within(20, lambda: shared.client.llen(PARTS_QUEUE) == 0)
    within(20, lambda: worker.log.read_text().count("succeeded in") >= 4)
    assert shared.client.zrange(parts_key(job_id, 1, 1), 0, -1, withscores=True) == [
        (str(part), 0.0) for part in range(4)
    ]


def test_claims_are_leases_of_the_attempt_that_runs(shared: Fleet) -> None:
    run, key = shared.records.run, parts_key("a", 1, 7)
    job = Job(id="a", owner="me", status="queued", created_at=0)
    assert run(create(job, most_jobs=0, most_bytes=0))
    open_round(shared.client, "a", 1, 7, 2, 60)
    assert run(claim_part("a", 1, 7, "us")) == NOTHING  # it does not run
    assert run(claim("a")) == 1
    assert [run(claim_part("a", 1, 7, "us")) for _ in range(3)] == [0, 1, NOTHING]
    assert 0 < shared.client.ttl(key) <= 61
    assert run(renew_part("a", 1, 7, 0, "us")) == 1
    assert run(end_part("a", 1, 7, 0)) == 1
    assert run(end_part("a", 1, 7, 0)) == 0
    assert run(renew_part("a", 1, 7, 0, "us")) == 0
    shared.client.zadd(key, {"1": 1.0})  # long ago
    assert run(claim_part("a", 1, 7, "others")) == 1
    until = shared.client.zscore(key, "1")
    assert run(renew_part("a", 1, 7, 1, "us")) == 0  # who has lost it
    assert shared.client.zscore(key, "1") == until
    assert run(renew_part("a", 1, 7, 1, "others")) == 1
    assert 0 < shared.client.ttl(holders_key("a", 1, 7)) <= 61
    assert run(claim_part("a", 2, 7, "us")) == NOTHING
    shared.client.delete("gcvec:lease:a")
    assert run(claim("a")) == 2
    assert [run(step) for step in (renew_part("a", 1, 7, 1, "others"), end_part("a", 1, 7, 1))] == [0, 0]


def test_no_helper_keeps_a_job_waiting(shared: Fleet) -> None:
    """While jobs wait, invitations are turned down."""
    job = Job(id="a", owner="me", status="queued", created_at=time.time())
    assert shared.records.run(create(job, most_jobs=0, most_bytes=0))
    assert shared.records.run(claim("a")) == 1
    open_round(shared.client, "a", 1, 1, 1, 60)
    send(shared, (VECTORIZE, ["another"]), (ASSIST, ["a", 1, 1]))
    worker = shared.start_worker(queues=(PARTS_QUEUE,))
    within(20, lambda: "succeeded in" in worker.log.read_text())
    assert shared.client.llen(JOBS_QUEUE) == 1
    assert shared.client.zrange(parts_key("a", 1, 1), 0, -1, withscores=True) == [("0", 0.0)]
