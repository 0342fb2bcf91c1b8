"""Workshops for tests of tasks that are called and not sent."""

from __future__ import annotations

from pathlib import Path

from tests.broker import client_of
from worker import storage
from worker.records import JobRecords
from worker.settings import Settings
from worker.workshop import Workshop


def empty_workshop(broker_url: str, data_dir: Path) -> Workshop:
    """One whose server holds nothing, and whose files go into a folder."""
    client = client_of(broker_url)
    client.flushall()
    settings = Settings(broker_url=broker_url, data_dir=data_dir)
    records = JobRecords(client)
    return Workshop(settings, storage.open_store(settings.storage), client, records, records)
