"""Finds folders in the store that belong to no job: what an API left that died in mid-upload.

To a Redis that came up empty, or is another service's, every folder looks like that. So each has an id,
`gcvec:id`, which the first to meet a store leaves there; only that one may say what belongs to no job.
"""

from __future__ import annotations

import time
import uuid
from typing import Final

import obstore
import redis
from obstore.store import ObjectStore

from worker import storage
from worker.records import JobRecords

REDIS_ID: Final = "gcvec:id"
FOREIGN_STORE: Final = "gcvec:foreign-store"
"""Set while the store belongs to another Redis."""


def may_judge(client: redis.Redis, store: ObjectStore) -> bool:
    """Whether this Redis has known the store's jobs from the beginning; noted for the metrics."""
    client.set(REDIS_ID, uuid.uuid4().hex, nx=True)
    ours = storage.claim_for(store, str(client.get(REDIS_ID))) == client.get(REDIS_ID)
    if ours:
        client.delete(FOREIGN_STORE)
    else:
        client.set(FOREIGN_STORE, "1")
    return ours


def remove_orphans(store: ObjectStore, records: JobRecords, age: float) -> list[str]:
    """Delete the folders of unknown jobs in which nothing was written for `age` seconds; their job ids.

    Uploads are stored before their job is recorded: a younger folder may get its record yet.
    """
    youngest = time.time() - age
    removed = []
    for folder in obstore.list_with_delimiter(store, storage.job_folder(""))["common_prefixes"]:
        job_id = folder.rstrip("/").rpartition("/")[2]
        if records.get(job_id) is None and storage.last_written(store, folder) < youngest:
            storage.delete_folder(store, folder)
            removed.append(job_id)
    return removed
