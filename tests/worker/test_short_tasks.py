from __future__ import annotations

import time
import uuid
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gcvec import vectorize
from tests.worker.workshops import empty_workshop
from worker import short_tasks, storage
from worker.artifacts import KINDS
from worker.export import load_image
from worker.job import Job
from worker.questions import PENDING, TAKEN, Answer, question_key, take, withdraw
from worker.steps import record_key, revise
from worker.storage import Manifest
from worker.workshop import Workshop

KEY = "a-question"
RED: dict[str, Any] = {"moves": [], "recolors": [{"patch": 0, "color": "#ff0000"}]}


@pytest.fixture
def shop(broker_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workshop:
    shop = empty_workshop(broker_url, tmp_path)
    monkeypatch.setattr(short_tasks, "workshop", lambda: shop)
    return shop


@pytest.fixture
def job_id(shop: Workshop) -> str:
    """A job that has succeeded; its result is one even region."""
    job = Job(id=uuid.uuid4().hex, owner="me", status="succeeded", created_at=time.time())
    shop.client.hset(record_key(job.id), mapping=job.to_fields())
    image = vectorize(np.full((8, 8, 3), 90, np.uint8)).to_bytes()
    path = f"{storage.attempt_folder(job.id, 1)}/{KINDS['gcv'].filename}"
    assert storage.commit(shop.store, job.id, Manifest(1, {"gcv": storage.write(shop.store, path, image)}))
    return job.id


def recolor(shop: Workshop, job_id: str) -> Answer:
    short_tasks.edit_image(KEY, job_id, 0, RED)
    return Answer.from_json(str(shop.client.get(question_key(KEY))))


def manifest_gcv(shop: Workshop, job_id: str) -> str:
    manifest = storage.read_manifest(shop.store, job_id)
    assert manifest is not None
    return manifest.files["gcv"].path


def revisions(shop: Workshop, job_id: str) -> int:
    job = shop.records.get(job_id)
    assert job is not None
    return job.revisions


def test_an_edit_that_is_awaited_is_made(shop: Workshop, job_id: str) -> None:
    shop.client.set(question_key(KEY), PENDING)
    assert recolor(shop, job_id) == Answer(1)
    assert storage.read_manifest(shop.store, job_id, 1) is not None


def test_an_edit_whose_answer_was_lost_is_not_made_again(shop: Workshop, job_id: str) -> None:
    """Nor is its revision counted twice where the answer to that was lost."""
    for _ in range(2):
        shop.client.set(question_key(KEY), PENDING)
        assert recolor(shop, job_id) == Answer(1)
        assert shop.records.run(revise(job_id, question_key(KEY))) == 1
    shop.client.set(question_key("another"), PENDING)
    assert shop.records.run(revise(job_id, question_key("another"))) == 2
    job = shop.records.get(job_id)
    assert job is not None
    assert job.revisions == 2


def test_an_edit_that_nobody_waits_for_any_more_is_not_made(shop: Workshop, job_id: str) -> None:
    short_tasks.edit_image(KEY, job_id, 0, RED)
    assert shop.client.get(question_key(KEY)) is None
    assert revisions(shop, job_id) == 0
    assert storage.read_manifest(shop.store, job_id, 1) is None


def test_a_file_that_was_made_meanwhile_is_not_made_again(shop: Workshop, job_id: str) -> None:
    for _ in range(2):
        shop.client.set(question_key(KEY), PENDING)
        short_tasks.export_image(KEY, job_id, 0, "svg", 1.0, "image.svg")
        assert Answer.from_json(str(shop.client.get(question_key(KEY)))) == Answer()
    file = storage.read_derived(shop.store, job_id, 0, "image.svg")
    job = shop.records.get(job_id)
    assert file is not None
    assert job is not None
    assert job.bytes == file.size


def test_an_export_that_nobody_waits_for_is_not_made(shop: Workshop, job_id: str) -> None:
    short_tasks.export_image(KEY, job_id, 0, "svg", 1.0, "image.svg")
    assert storage.read_derived(shop.store, job_id, 0, "image.svg") is None


def test_an_edit_withdrawn_while_it_is_made_is_not_kept(
    shop: Workshop, job_id: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slowly(*_: Any) -> Any:
        assert shop.client.get(question_key(KEY)) == TAKEN
        assert shop.records.run(take(KEY, "other")) == 0
        assert shop.records.run(withdraw(KEY)) == 1
        return image

    from worker import edit

    image = edit.edited(load_image(shop.store, manifest_gcv(shop, job_id)), RED)
    monkeypatch.setattr(edit, "edited", slowly)
    shop.client.set(question_key(KEY), PENDING)
    problem = recolor(shop, job_id).problem
    assert problem is not None
    assert problem.code == "unavailable"
    assert revisions(shop, job_id) == 0
    assert shop.records.run(withdraw(KEY)) == 0  # it has been answered


def test_a_job_is_said_to_be_removed_once(
    shop: Workshop, job_id: str, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level("INFO", "worker.short_tasks"):
        for _ in range(3):
            short_tasks.remove_job(job_id)
    assert len(caplog.messages) == 1
