"""`/v1/jobs`: submit, watch, list and delete jobs."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Depends, File, Form, Header, Query, Response, UploadFile
from fastapi.responses import StreamingResponse

from service.deps import JobDep, OwnerDep, ServicesDep
from service.described import answer_headers
from service.errors import ProblemError, documented
from service.idempotency import IdempotencyKey
from service.jobs import service
from service.jobs.repository import cursor, position
from service.jobs.schemas import JobOptions, JobPage, JobView, Webhook, job_path, json_of
from service.jobs.uploads import Upload, check_parts, name_of, read_file, read_options, read_webhook

router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

_RETRY_AFTER = "1"
_LARGEST_ID = 2**53
"""As large a number as JSON is sure to keep, and more than a job has events."""


@router.post(
    "",
    status_code=202,
    summary="Submit a picture",
    dependencies=[Depends(check_parts)],
    responses={
        202: {"headers": answer_headers("Location", "Retry-After")},
        **documented(400, 401, 403, 408, 409, 410, 413, 415, 422, 429, 503),
    },
)
async def submit_job(
    services: ServicesDep,
    owner: OwnerDep,
    image: Annotated[UploadFile, File(description="the picture: PNG, JPEG, WebP or TIFF")],
    response: Response,
    annotations: Annotated[
        UploadFile | None, File(description="its regions: CVAT XML, COCO JSON or a zip with either")
    ] = None,
    options: Annotated[
        str | None,
        Form(
            description="the options of the command line, a JSON object",
            examples=['{"target_mse": 5}'],
            json_schema_extra=json_of(JobOptions),
        ),
    ] = None,
    webhook: Annotated[
        str | None,
        Form(description="whom to tell how the job fares, a JSON object", json_schema_extra=json_of(Webhook)),
    ] = None,
    idempotency_key: IdempotencyKey = None,
) -> JobView:
    """Queue a picture for vectorization. The answer's `Location` is the job."""
    upload = Upload(
        image=await read_file(image, "image", services.settings),
        picture_name=name_of(image),
        annotations=await read_file(annotations, "annotations", services.settings) if annotations else None,
        options=read_options(options),
        webhook=read_webhook(webhook, services.settings),
    )
    job = await service.submit(services, owner, upload, idempotency_key)
    response.headers["Location"] = job_path(job.id)
    response.headers["Retry-After"] = _RETRY_AFTER
    return JobView.of(job)


@router.get("", summary="List jobs", responses=documented(401, 403, 422, 429, 503))
async def list_jobs(
    services: ServicesDep,
    owner: OwnerDep,
    cursor_text: Annotated[str | None, Query(alias="cursor", max_length=200)] = None,
    limit: Annotated[int, Query(ge=1, le=100)] = 20,
) -> JobPage:
    """The caller's jobs, newest first."""
    try:
        before = None if cursor_text is None else position(cursor_text)
    except (ValueError, TypeError):
        raise ProblemError(
            "invalid-request", "the cursor is not one of ours", pointer="/query/cursor"
        ) from None
    jobs = await services.jobs.page(owner, before, limit + 1)
    more = len(jobs) > limit
    shown = jobs[:limit]
    following = f"/v1/jobs?limit={limit}&cursor={cursor(shown[-1])}" if more else None
    return JobPage(jobs=[JobView.of(job) for job in shown], next=following)


@router.head("/{job_id}", include_in_schema=False)
@router.get(
    "/{job_id}",
    summary="Look at a job",
    responses={
        200: {"headers": answer_headers("Retry-After", always=False)},
        **documented(401, 403, 404, 410, 422, 429, 503),
    },
)
async def get_job(
    job: JobDep,
    services: ServicesDep,
    response: Response,
    wait: Annotated[float, Query(ge=0, le=30, description="seconds to wait for the end of the job")] = 0,
) -> JobView:
    """The job as it is now, or as it is once it has finished or `wait` seconds have passed."""
    job = await service.wait(services, job, wait)
    if not job.finished:
        response.headers["Retry-After"] = _RETRY_AFTER
    response.headers["Cache-Control"] = "no-store"
    return JobView.of(job)


@router.get(
    "/{job_id}/events",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"text/event-stream": {}}},
        204: {"description": "Nothing is to come"},
        **documented(401, 403, 404, 410, 422, 429, 503),
    },
    summary="Watch a job",
)
async def watch_job(
    job: JobDep,
    services: ServicesDep,
    last_event_id: Annotated[int, Header(ge=0, le=_LARGEST_ID)] = 0,
) -> Response:
    """Server-sent events: `snapshot`, one `progress` a refinement iteration, a final `state`, then the end.

    Events carry increasing ids; `Last-Event-ID` resumes after one. A client that has seen the final state
    gets 204, which stops browsers from connecting again.
    """
    if job.finished and last_event_id >= job.last_event:
        return Response(status_code=204)
    events = service.stream(services, job, last_event_id)
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return StreamingResponse(events, headers=headers, media_type="text/event-stream")


@router.delete(
    "/{job_id}",
    status_code=204,
    response_class=Response,  # of no type: there is no content
    summary="Cancel or delete a job",
    responses=documented(401, 403, 404, 410, 422, 429, 503),
)
async def delete_job(job: JobDep, services: ServicesDep) -> None:
    """Cancel a job that has not finished; remove its input and results."""
    await service.delete(services, job)
