"""A store that is full or refuses; files that nobody needs any more."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.fleet import ENDLESS, SHORT, Fleet
from tests.waiting import within
from worker import storage
from worker.orphans import remove_orphans

pytestmark = [pytest.mark.service, pytest.mark.slow]


def test_a_full_disk_fails_the_job_and_leaves_no_half_result(fleet: Fleet) -> None:
    api = fleet.start_api()
    worker = fleet.start_worker(largest_file=20_000)  # writes beyond it fail, as on a full disk
    job_id = api.submit(96, **SHORT)
    failed = api.outcome(job_id)
    assert failed["error"]["type"] == "urn:gcvec:problem:storage-failed"
    assert str(fleet.folder) not in str(failed)
    assert fleet.manifest(job_id) is None
    inputs = [f"jobs/{job_id}/input/annotations", f"jobs/{job_id}/input/image"]
    within(10, lambda: fleet.files(job_id) == inputs)
    assert api.http.get(f"/v1/jobs/{job_id}/result").status_code == 409
    worker.kill()
    fleet.start_worker()
    assert api.outcome(api.submit(96, **SHORT))["status"] == "succeeded"


def test_a_store_that_refuses_an_upload_is_unavailable(fleet: Fleet) -> None:
    api = fleet.start_api()
    (fleet.folder / "store" / "jobs").write_text("not a folder")
    answer = api.post(**SHORT)
    assert answer.status_code == 503
    assert int(answer.headers["retry-after"]) > 0
    assert str(fleet.folder) not in answer.text
    assert api.http.get("/v1/jobs").json()["jobs"] == []
    assert fleet.client.llen("gcvec-jobs") == 0


def test_what_has_expired_goes_and_nothing_else(start_fleet: Callable[..., Fleet]) -> None:
    fleet = start_fleet(GCVEC_RETENTION="3")
    api = fleet.start_api()
    fleet.start_worker(concurrency=2)
    running = api.submit(**ENDLESS)
    within(20, lambda: fleet.refining(running))
    foreign = fleet.folder / "store" / "other" / "file"
    foreign.parent.mkdir()
    foreign.write_text("mine")
    done = api.submit(**SHORT)
    assert api.outcome(done)["status"] == "succeeded"
    within(20, lambda: fleet.files(done) == [])
    within(5, lambda: fleet.records.get(done) is None)
    assert api.http.get(f"/v1/jobs/{done}").status_code == 410
    assert api.http.get(f"/v1/jobs/{running}").json()["status"] == "running"
    assert fleet.files(running) != []
    assert foreign.read_text() == "mine"


def test_files_of_no_job_go_when_they_are_old(start_fleet: Callable[..., Fleet]) -> None:
    fleet = start_fleet(GCVEC_ORPHAN_AGE="2")
    api = fleet.start_api()
    fleet.start_worker()
    kept = api.submit(**SHORT)
    assert api.outcome(kept)["status"] == "succeeded"
    files = fleet.files(kept)
    store = storage.open_store(fleet.environment["GCVEC_STORAGE_URL"])
    storage.write(store, storage.image_path("orphan"), b"left by an upload that died")
    within(15, lambda: fleet.files("orphan") == [])
    time.sleep(1)
    assert fleet.files(kept) == files


def test_a_young_folder_without_a_record_is_left_alone(fleet: Fleet) -> None:
    store = storage.open_store(fleet.environment["GCVEC_STORAGE_URL"])
    for name in ("old", "young"):
        storage.write(store, storage.image_path(name), b"x")
    past = time.time() - 7200
    os.utime(fleet.folder / "store" / Path(storage.image_path("old")), (past, past))
    assert remove_orphans(store, fleet.records, 3600) == ["old"]
    assert fleet.files() == ["jobs/young/input/image"]


def test_a_redis_that_has_lost_its_memory_has_nothing_removed(start_fleet: Callable[..., Fleet]) -> None:
    fleet = start_fleet(GCVEC_ORPHAN_AGE="1")
    api = fleet.start_api()
    fleet.start_worker()
    job_id = api.submit(24, **SHORT)
    assert api.outcome(job_id)["status"] == "succeeded"
    mark = fleet.folder / "store" / "redis.id"
    within(10, mark.exists)
    files, known = fleet.files(job_id), mark.read_text()

    fleet.broker.kill()
    shutil.rmtree(fleet.folder / "broker")
    (fleet.folder / "broker").mkdir()
    fleet.start_broker()
    within(20, api.ready)
    within(20, lambda: "gcvec_store_foreign 1.0" in api.http.get("/metrics").text)
    assert api.http.get(f"/v1/jobs/{job_id}").status_code == 404
    assert fleet.client.get("gcvec:id") not in (None, known)
    time.sleep(2)  # twice the age of orphans
    assert fleet.files(job_id) == files
    assert mark.read_text() == known

    mark.unlink()
    within(20, lambda: fleet.files(job_id) == [])
    within(20, lambda: "gcvec_store_foreign 0.0" in api.http.get("/metrics").text)
