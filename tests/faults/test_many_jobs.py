"""Many jobs while workers are killed at random and the broker is restarted."""

from __future__ import annotations

import random
import threading
import time
from collections import Counter
from collections.abc import Callable
from functools import partial

import pytest

from tests.fleet import Fleet, Process, servers
from tests.waiting import within

pytestmark = [pytest.mark.service, pytest.mark.slow]

JOBS = 200
KILL_EVERY = 4.0
ATTEMPTS = 20
"""No job is given up, however often a worker is killed in the midst of it."""


def test_every_job_succeeds_once(start_fleet: Callable[..., Fleet]) -> None:
    fleet = start_fleet(servers()[0], GCVEC_JOB_ATTEMPTS=str(ATTEMPTS))
    api = fleet.start_api()
    workers = [fleet.start_worker() for _ in range(2)]
    stopping = threading.Event()
    killer = threading.Thread(target=kill_now_and_then, args=(fleet, workers, stopping))
    killer.start()
    try:
        ids = [api.submit(24, number, target_mse=40) for number in range(JOBS // 2)]
        fleet.broker.kill()
        time.sleep(0.5)
        fleet.start_broker()
        within(20, api.ready)
        ids += [api.submit(24, number, target_mse=40) for number in range(JOBS // 2, JOBS)]
        within(240, lambda: fleet.client.hget("gcvec:totals", "finished:succeeded") == str(JOBS))
    finally:
        stopping.set()
        killer.join()

    jobs = [fleet.job(job_id) for job_id in ids]
    assert Counter(job.status for job in jobs) == {"succeeded": JOBS}
    assert len(set(ids)) == JOBS
    assert all(fleet.ends_of(job_id) == ["succeeded"] for job_id in ids)
    for job in jobs:
        manifest = fleet.manifest(job.id)
        assert manifest is not None
        within(10, partial(keeps_only, fleet, job.id, manifest.attempt))
        assert len(fleet.files(job.id)) == 3 + len(manifest.files)
    assert max(job.attempt for job in jobs) > 1, "no kill has hit a job"
    assert fleet.client.zcard("gcvec:active") == 0
    assert fleet.client.scard("gcvec:unfinished:anyone") == 0
    kept_bytes = sum(job.bytes for job in jobs)
    assert fleet.client.hget("gcvec:stored", "anyone") == str(kept_bytes)


def keeps_only(fleet: Fleet, job_id: str, attempt: int) -> bool:
    return fleet.attempts_of(job_id) == {f"attempt-{attempt}"}


def kill_now_and_then(fleet: Fleet, workers: list[Process], stopping: threading.Event) -> None:
    """Kill a worker in the midst of a job and start another in its place, until told to stop."""
    chance = random.Random(7)
    while not stopping.wait(chance.uniform(0.5, 1.5) * KILL_EVERY):
        place = chance.randrange(len(workers))
        while not busy(workers[place]):
            if stopping.wait(0.005):
                return
        workers[place].kill()
        workers[place] = fleet.start_worker(ready=False)


def busy(worker: Process) -> bool:
    return ": attempt " in worker.log.read_text().rpartition("succeeded in attempt")[2]
