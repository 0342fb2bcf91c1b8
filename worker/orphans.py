"""Finds folders in the store that belong to no job: what an API left that died in mid-upload."""

from __future__ import annotations

import time

import obstore
from obstore.store import ObjectStore

from worker import storage
from worker.records import JobRecords


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
