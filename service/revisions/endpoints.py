"""`/v1/jobs/{id}/edits` and `/v1/jobs/{id}/revisions`: change a result; the original stays."""

from __future__ import annotations

import hashlib

from fastapi import APIRouter

from service.artifacts.service import RevisedDep, find_result
from service.deps import JobDep, OwnerDep, Services, ServicesDep
from service.errors import ProblemError, documented
from service.idempotency import IdempotencyKey
from service.quota import require_room
from service.revisions.schemas import Edits, RevisionView
from worker.job import Job
from worker.queues import EDIT

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["edits"])

_EDIT_SECONDS = 50.0


@router.post(
    "/edits",
    summary="Edit a result",
    responses=documented(400, 401, 403, 404, 408, 409, 410, 413, 422, 429, 500, 503),
)
async def edit_job(
    edits: Edits,
    job: JobDep,
    owner: OwnerDep,
    services: ServicesDep,
    idempotency_key: IdempotencyKey = None,
) -> RevisionView:
    """Move control points and recolour patches. Makes a new revision, without refitting."""
    request = f"{job.id}\n{edits.model_dump_json()}"
    fingerprint = hashlib.sha256(request.encode()).hexdigest()
    async with services.idempotency.once(owner, idempotency_key, fingerprint) as once:
        if once.outcome is None:
            once.outcome = str(await _edit(services, job, edits, once.identity))
    return RevisionView.of(job.id, int(once.outcome))


@router.get(
    "/revisions/{revision}",
    summary="Look at a revision",
    responses=documented(401, 403, 404, 409, 410, 422, 429, 503),
)
async def get_revision(result: RevisedDep) -> RevisionView:
    """A revision's links."""
    return RevisionView.of(result.job.id, result.revision)


async def _edit(services: Services, job: Job, edits: Edits, identity: str | None) -> int:
    """The number of the new revision, or of the one that the same request has made before."""
    await find_result(services, job, edits.revision)
    if not edits.moves and not edits.recolors:
        raise ProblemError("invalid-request", "there is nothing to change", pointer="/body")
    await require_room(services, job.owner)
    changes = edits.model_dump(exclude={"revision"})
    args = [job.id, edits.revision, changes]
    answer = await services.questions.ask_alone(EDIT, args, _EDIT_SECONDS, identity)
    if answer is None:
        raise ProblemError("unavailable", "no worker has made the edit in time", headers={"Retry-After": "5"})
    return int(answer.value)
