"""Workers that die, stall or are sent away: every job ends once, with one result."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fleet import ENDLESS, LONG, ON_EVERY_SERVER, SHORT, Fleet
from tests.waiting import within
from worker import storage
from worker.steps import claim, lease_key
from worker.storage import Manifest

pytestmark = [pytest.mark.service, pytest.mark.slow]


@ON_EVERY_SERVER
def test_a_job_whose_worker_is_killed_is_finished_by_another(
    start_fleet: Callable[..., Fleet], server: Path
) -> None:
    fleet = start_fleet(server)
    api, first = fleet.start_api(), fleet.start_worker()
    job_id = api.submit(**LONG | {"max_points": 250})
    within(20, lambda: fleet.refining(job_id))
    first.kill()
    fleet.start_worker(ready=False)
    assert api.outcome(job_id, 30)["status"] == "succeeded"
    manifest = fleet.manifest(job_id)
    assert manifest is not None
    assert manifest.attempt == fleet.job(job_id).attempt == 2
    assert fleet.attempts_of(job_id) == {"attempt-2"}
    assert fleet.ends_of(job_id) == ["succeeded"]
    assert api.http.get(f"/v1/jobs/{job_id}/result").status_code == 200


def test_results_that_were_complete_when_their_worker_died_are_the_jobs(fleet: Fleet) -> None:
    api = fleet.start_api()
    job_id = api.submit(24, **SHORT)
    assert fleet.records.run(claim(job_id)) == 1
    store = storage.open_store(fleet.environment["GCVEC_STORAGE_URL"])
    file = storage.write(store, f"{storage.attempt_folder(job_id, 1)}/result.gcv", b"made by the first")
    assert storage.commit(store, job_id, Manifest(1, {"gcv": file}, ("careful",)))
    assert api.http.get(f"/v1/jobs/{job_id}/result.gcv").status_code == 409
    fleet.client.delete(lease_key(job_id))
    fleet.start_worker()
    job = api.outcome(job_id)
    assert (job["status"], job["warnings"]) == ("succeeded", ["careful"])
    assert api.http.get(f"/v1/jobs/{job_id}/result.gcv").content == b"made by the first"
    assert fleet.job(job_id).attempt == 2
    assert fleet.attempts_of(job_id) == {"attempt-1"}
    assert fleet.ends_of(job_id) == ["succeeded"]


def test_an_attempt_that_was_given_up_changes_nothing_when_it_wakes(fleet: Fleet) -> None:
    api, first = fleet.start_api(), fleet.start_worker()
    job_id = api.submit(**LONG)
    within(20, lambda: fleet.refining(job_id))
    (asleep,) = first.children()
    assert os.sched_getscheduler(asleep) == os.SCHED_BATCH
    os.kill(asleep, signal.SIGSTOP)
    fleet.start_worker()
    assert api.outcome(job_id, 40)["status"] == "succeeded"
    record = fleet.client.hgetall(f"gcvec:job:{job_id}")
    files = fleet.files(job_id)
    assert record["attempt"] == "2"
    os.kill(asleep, signal.SIGCONT)
    within(20, lambda: f"job {job_id}: attempt 1 stopped" in first.log.read_text())
    assert fleet.client.hgetall(f"gcvec:job:{job_id}") == record
    assert fleet.files(job_id) == files
    assert fleet.attempts_of(job_id) == {"attempt-2"}
    assert fleet.ends_of(job_id) == ["succeeded"]


def test_a_job_that_kills_its_workers_is_given_up_and_harms_no_other(fleet: Fleet) -> None:
    api, worker = fleet.start_api(), fleet.start_worker()
    poison = api.submit(**ENDLESS)
    others = [api.submit(seed=number, **SHORT) for number in range(3)]
    for attempt in (1, 2, 3):
        within(40, lambda number=attempt: fleet.refining(poison, number))
        (process,) = worker.children()
        os.kill(process, signal.SIGKILL)
    failed = api.outcome(poison, 40)
    assert failed["status"] == "failed"
    assert failed["error"]["type"] == "urn:gcvec:problem:worker-lost"
    assert fleet.ends_of(poison) == ["failed"]
    assert fleet.attempts_of(poison) == set()
    for job_id in others:
        assert api.outcome(job_id)["status"] == "succeeded"
        assert fleet.job(job_id).attempt == 1


def test_a_worker_that_is_asked_to_end_finishes_its_job_and_takes_no_other(fleet: Fleet) -> None:
    api, first = fleet.start_api(), fleet.start_worker()
    running = api.submit(**LONG | {"max_points": 200})
    within(20, lambda: fleet.refining(running))
    waiting = api.submit(**SHORT)
    assert first.ask_to_stop(signal.SIGTERM, 60) == 0
    assert (fleet.job(running).status, fleet.job(running).attempt) == ("succeeded", 1)
    assert fleet.job(waiting).status == "queued"
    assert fleet.client.llen("gcvec-jobs") == 1


def test_a_worker_that_is_sent_away_hands_its_job_back(fleet: Fleet) -> None:
    api, first = fleet.start_api(), fleet.start_worker()
    job_id = api.submit(**ENDLESS)
    within(20, lambda: fleet.refining(job_id))
    fleet.start_worker()
    assert first.ask_to_stop(signal.SIGQUIT) == 0
    within(30, lambda: fleet.refining(job_id, 2))
    assert fleet.ends_of(job_id) == []


def test_a_job_may_not_run_for_ever(start_fleet: Callable[..., Fleet]) -> None:
    fleet = start_fleet(GCVEC_JOB_SECONDS="2")
    api = fleet.start_api()
    fleet.start_worker()
    failed = api.outcome(api.submit(**ENDLESS), 20)
    assert failed["error"]["type"] == "urn:gcvec:problem:time-limit"
    assert "2 s" in failed["error"]["detail"]
    assert api.outcome(api.submit(**SHORT))["status"] == "succeeded"


def test_a_job_may_not_use_all_memory(start_fleet: Callable[..., Fleet]) -> None:
    fleet = start_fleet(GCVEC_JOB_MEMORY_BYTES="700000000")
    api = fleet.start_api()
    fleet.start_worker()
    failed = api.outcome(api.submit(3000, **SHORT), 60)
    assert failed["status"] == "failed"
    assert failed["error"]["type"] == "urn:gcvec:problem:memory-limit"
    assert api.outcome(api.submit(**SHORT))["status"] == "succeeded"
