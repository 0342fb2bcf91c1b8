"""How attempts of a job end, when more than one was made."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

import pytest

from tests.worker.workshops import empty_workshop
from worker import produce, storage, tasks
from worker.job import Job
from worker.steps import claim, create, lease_key
from worker.storage import Manifest
from worker.workshop import Workshop


@pytest.fixture
def shop(broker_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workshop:
    shop = empty_workshop(broker_url, tmp_path)
    monkeypatch.setattr(tasks, "workshop", lambda: shop)
    return shop


def begun(shop: Workshop) -> Job:
    """A job whose first attempt has begun, and has lost its lease since."""
    request = {"annotations": False, "options": {}}
    job = Job(id=uuid.uuid4().hex, owner="me", status="queued", created_at=time.time(), request=request)
    storage.write(shop.store, storage.image_path(job.id), b"a picture")
    assert shop.records.run(create(job, most_jobs=0, most_bytes=0)) == 1
    assert shop.records.run(claim(job.id)) == 1
    shop.client.delete(lease_key(job.id))
    return read(shop, job.id)


def read(shop: Workshop, job_id: str) -> Job:
    job = shop.records.get(job_id)
    assert job is not None
    return job


def deliver(shop: Workshop, job: Job) -> None:
    """Let an attempt that has come to its end store what it has made."""
    path = f"{storage.attempt_folder(job.id, job.attempt)}/result.gcv"
    manifest = Manifest(job.attempt, {"gcv": storage.write(shop.store, path, b"patches")})
    assert storage.commit(shop.store, job.id, manifest)
    tasks._succeed(shop, job, manifest)


def out_of_memory(before: Callable[[], None] = lambda: None) -> Callable[..., NoReturn]:
    """A computation that fails after something else has happened."""

    def fail(*_: Any) -> NoReturn:
        before()
        raise MemoryError

    return fail


def test_a_late_failure_takes_away_nothing_that_was_delivered(
    shop: Workshop, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = begun(shop)
    monkeypatch.setattr(produce, "produce", out_of_memory(lambda: deliver(shop, first)))
    tasks.vectorize_job(first.id)
    now = read(shop, first.id)
    assert (now.status, now.attempt) == ("succeeded", 2)
    manifest = storage.read_manifest(shop.store, first.id)
    assert manifest is not None
    assert storage.read(shop.store, manifest.files["gcv"].path) == b"patches"


def test_a_failure_leaves_no_files_of_any_attempt(shop: Workshop, monkeypatch: pytest.MonkeyPatch) -> None:
    first = begun(shop)
    storage.write(shop.store, f"{storage.attempt_folder(first.id, 1)}/result.gcv", b"half of it")
    monkeypatch.setattr(produce, "produce", out_of_memory())
    tasks.vectorize_job(first.id)
    assert read(shop, first.id).status == "failed"
    assert storage.last_written(shop.store, storage.attempt_folder(first.id, 1)) == 0
