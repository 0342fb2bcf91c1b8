"""What endpoints ask for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from celery import Celery
from fastapi import Depends, Path, Request, Security
from fastapi.security import HTTPBearer
from obstore.store import ObjectStore

from service.access.rates import Rates
from service.errors import ProblemError
from service.idempotency import Idempotency
from service.jobs.repository import Changes, JobRepository
from service.questions import Questions
from worker import logs
from worker.job import Job
from worker.settings import Settings


@dataclass(frozen=True)
class Services:
    """What one API process shares among its requests. None of it is state: that is in Redis and the store."""

    settings: Settings
    jobs: JobRepository
    changes: Changes
    questions: Questions
    idempotency: Idempotency
    rates: Rates
    store: ObjectStore
    queue: Celery


# Dependencies are coroutines even where they wait for nothing: others are run in a thread, at more cost.
async def get_services(request: Request) -> Services:
    return _services(request)


def _services(request: Request) -> Services:
    services: Services = request.app.state.services
    return services


_BEARER = HTTPBearer(auto_error=False, description="An API key. A service on loopback may need none.")


async def get_owner(request: Request, _: Annotated[object, Security(_BEARER)]) -> str:
    """Whose request it is, as `service.access.gate` has found out."""
    return _owner(request)


def _owner(request: Request) -> str:
    owner: str = request.state.owner
    return owner


ServicesDep = Annotated[Services, Depends(get_services)]
OwnerDep = Annotated[str, Depends(get_owner)]
JobId = Annotated[str, Path(description="The job's id.")]


async def get_job(job_id: JobId, request: Request, _: Annotated[object, Security(_BEARER)]) -> Job:
    """The caller's job. Another owner's is answered like one that never was."""
    found_owner, job = await _services(request).jobs.find(job_id)
    if found_owner != _owner(request):
        raise ProblemError("not-found", "there is no job of this id")
    if job is None:
        raise ProblemError("gone", "the job has expired or was deleted")
    logs.from_now_on_about(job_id)
    return job


JobDep = Annotated[Job, Depends(get_job)]
