"""What a worker process works with."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import redis
from obstore.store import ObjectStore

from worker import storage
from worker.records import JobRecords, connect
from worker.settings import Settings, get_settings


@dataclass(frozen=True)
class Workshop:
    """When Redis is away `records` waits for it, `progress` gives up at once."""

    settings: Settings
    store: ObjectStore
    client: redis.Redis
    records: JobRecords
    progress: JobRecords


@lru_cache
def workshop() -> Workshop:
    """The workshop of this process, opened by its first task."""
    settings = get_settings()
    client = connect(settings.broker_url, patient=True)
    return Workshop(
        settings=settings,
        store=storage.open_store(settings.storage),
        client=client,
        records=JobRecords(client),
        progress=JobRecords(connect(settings.broker_url, patient=False)),
    )
