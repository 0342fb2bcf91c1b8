"""Finding the files of a finished job, and having those made that are made on demand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from anyio import to_thread
from fastapi import Depends, Path

from service.artifacts.description import LARGEST_NUMBER
from service.deps import JobDep, Services, ServicesDep
from service.errors import ProblemError
from service.quota import require_room
from worker import storage
from worker.job import Job
from worker.queues import EXPORT
from worker.storage import Manifest, StoredFile

_EXPORT_SECONDS = 25.0


@dataclass(frozen=True)
class Result:
    """What a job has made: the original (revision 0) or an edit of it."""

    job: Job
    revision: int
    manifest: Manifest


async def find_result(services: Services, job: Job, revision: int) -> Result:
    """A revision of the job's result. Raises ProblemError while, or if, there is none."""
    if not job.finished:
        raise ProblemError("not-ready", f"the job is {job.status}", headers={"Retry-After": "1"})
    if job.status != "succeeded":
        raise ProblemError("no-result", f"the job is {job.status}")
    manifest = await to_thread.run_sync(storage.read_manifest, services.store, job.id, revision)
    if manifest is not None:
        return Result(job, revision, manifest)
    if revision == 0:
        raise ProblemError("gone", "the job has expired or was deleted")
    raise ProblemError("not-found", "there is no revision of this number")


async def original(job: JobDep, services: ServicesDep) -> Result:
    """The result as the job made it."""
    return await find_result(services, job, 0)


async def revised(
    job: JobDep,
    services: ServicesDep,
    revision: Annotated[int, Path(ge=1, le=LARGEST_NUMBER, description="The revision's number.")],
) -> Result:
    """The revision that the address names."""
    return await find_result(services, job, revision)


RevisedDep = Annotated[Result, Depends(revised)]


async def derived_file(services: Services, result: Result, name: str, kind: str, scale: float) -> StoredFile:
    """The file `name` of a result; made now if it is asked for the first time.

    Raises ProblemError if it cannot be made, or not soon.
    """
    place = (services.store, result.job.id, result.revision, name)
    if (file := await to_thread.run_sync(storage.read_derived, *place)) is not None:
        return file
    await require_room(services, result.job.owner)
    key = f"{result.job.id}/{result.revision}/{name}"
    args = [result.job.id, result.revision, kind, scale, name]
    await services.questions.ask(key, EXPORT, args, _EXPORT_SECONDS)
    if (file := await to_thread.run_sync(storage.read_derived, *place)) is not None:
        return file
    raise ProblemError("not-ready", "the file is being made", headers={"Retry-After": "2"})
