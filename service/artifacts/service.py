"""Finding the files of a finished job."""

from __future__ import annotations

from anyio import to_thread

from service.deps import Services
from service.errors import ProblemError
from worker import storage
from worker.records import Job
from worker.storage import StoredFile


async def stored_file(services: Services, job: Job, name: str) -> StoredFile:
    """The artefact `name` of the job. Raises ProblemError while, or if, there is none."""
    if not job.finished:
        raise ProblemError("not-ready", f"the job is {job.status}", headers={"Retry-After": "1"})
    if job.status != "succeeded":
        raise ProblemError("no-result", f"the job is {job.status}")
    manifest = await to_thread.run_sync(storage.read_manifest, services.store, job.id)
    if manifest is None:
        raise ProblemError("gone", "the job has expired or was deleted")
    return manifest.files[name]
