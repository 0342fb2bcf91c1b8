"""Who calls a webhook when the same message was sent more than once."""

from __future__ import annotations

import time
import uuid
from pathlib import Path

import pytest

from tests.broker import client_of
from tests.webhook_receiver import SECRET, Receiver
from worker import delivery, storage
from worker.job import Job
from worker.records import JobRecords
from worker.settings import Settings
from worker.steps import record_key
from worker.webhooks import DELIVERIES, begin_try
from worker.workshop import Workshop


@pytest.fixture
def shop(broker_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Workshop:
    client = client_of(broker_url)
    client.flushall()
    settings = Settings(
        broker_url=broker_url, data_dir=tmp_path, webhook_private=True, webhook_pauses=(60, 90)
    )
    records = JobRecords(client)
    shop = Workshop(settings, storage.open_store(settings.storage), client, records, records)
    monkeypatch.setattr(delivery, "workshop", lambda: shop)
    return shop


@pytest.fixture
def entry(shop: Workshop, receiver: Receiver) -> str:
    """What is to be told of a job that has succeeded."""
    hook = {"url": receiver.url, "secret": SECRET, "events": ["job.succeeded"]}
    job = Job(id=uuid.uuid4().hex, owner="me", status="succeeded", created_at=time.time(), webhook=hook)
    shop.client.hset(record_key(job.id), mapping=job.to_fields())
    shop.client.zadd(DELIVERIES, {f"{job.id} succeeded": time.time()})
    return f"{job.id} succeeded"


def pause(shop: Workshop, entry: str) -> float:
    score = shop.client.zscore(DELIVERIES, entry)
    assert isinstance(score, float)
    return score - time.time()


def test_a_message_that_was_sent_twice_is_told_once(shop: Workshop, receiver: Receiver, entry: str) -> None:
    for _ in range(3):
        delivery.deliver(entry, 0)
    assert len(receiver.calls) == 1
    assert shop.client.zcard(DELIVERIES) == 0


def test_a_try_whose_answer_was_lost_is_made(shop: Workshop, entry: str) -> None:
    call = begin_try(entry, 0)
    assert shop.records.run(call) == shop.records.run(call) == 1
    assert shop.records.run(begin_try(entry, 0)) == 0
    assert shop.records.run(begin_try(entry, 1)) == 1
    assert shop.records.run(call) == 0


def test_messages_that_piled_up_use_up_one_try(shop: Workshop, receiver: Receiver, entry: str) -> None:
    receiver.status = 500
    for _ in range(5):
        delivery.deliver(entry, 0)
    assert len(receiver.calls) == 1
    assert pause(shop, entry) == pytest.approx(60, abs=5)
    delivery.deliver(entry, 1)
    assert pause(shop, entry) == pytest.approx(90, abs=5)
    delivery.deliver(entry, 2)
    assert len(receiver.calls) == 3
    assert shop.client.zcard(DELIVERIES) == 0
