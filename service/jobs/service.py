"""What can be done with jobs."""

from __future__ import annotations

import asyncio
import hashlib
import json
import logging
import time
import uuid
from collections.abc import AsyncIterator
from contextlib import suppress

import obstore
from anyio import to_thread
from fastapi.sse import format_sse_event
from kombu.exceptions import OperationalError
from obstore.exceptions import BaseError
from redis.exceptions import RedisError

from service.deps import Services
from service.errors import ProblemError, unavailable
from service.idempotency import Once
from service.jobs.repository import Event
from service.jobs.schemas import JobView
from service.jobs.uploads import Upload, check, request_of
from service.quota import no_room
from worker import logs, storage
from worker.job import Job
from worker.queues import VECTORIZE
from worker.steps import TOO_MANY_BYTES, TOO_MANY_JOBS, create, discard, finish, retire

logger = logging.getLogger(__name__)

_PING_SECONDS = 15.0


async def submit(services: Services, owner: str, upload: Upload, key: str | None) -> Job:
    """A new job, or the one that the same request with the same idempotency key has made before."""
    fingerprint = await to_thread.run_sync(fingerprint_of, upload)
    async with services.idempotency.once(owner, key, fingerprint) as once:
        if once.outcome is None:
            job = await _create(services, owner, upload, once)
            once.outcome = job.id
            return job
    _, earlier = await services.jobs.find(once.outcome)
    if earlier is None:
        raise ProblemError("gone", "the job that this request made has expired or was deleted")
    return earlier


async def _create(services: Services, owner: str, upload: Upload, once: Once) -> Job:
    """Check the upload, keep its files, record the job and queue it; on any failure nothing is left."""
    header = await to_thread.run_sync(check, upload, services.settings)
    digest = await to_thread.run_sync(hashlib.sha256, upload.image)
    await services.jobs.ping()
    job = Job(
        id=uuid.uuid4().hex,
        owner=owner,
        status="queued",
        created_at=time.time(),
        request={
            **request_of(upload),
            "width": header.width,
            "height": header.height,
            "sha256": digest.hexdigest(),
        },
        webhook=upload.webhook.model_dump() if upload.webhook else None,
        bytes=len(upload.image) + len(upload.annotations or b""),
    )
    logs.from_now_on_about(job.id)
    try:
        await _keep_files(services, job, upload)
        await _record(services, job, once)
        await to_thread.run_sync(_enqueue, services, job.id)
    except BaseException:
        await asyncio.shield(_undo(services, job))
        raise
    return job


async def _keep_files(services: Services, job: Job, upload: Upload) -> None:
    await obstore.put_async(services.store, storage.image_path(job.id), upload.image)
    if upload.annotations is not None:
        await obstore.put_async(services.store, storage.annotations_path(job.id), upload.annotations)


async def _record(services: Services, job: Job, once: Once) -> None:
    settings = services.settings
    limits = {"most_jobs": settings.max_unfinished_jobs, "most_bytes": settings.max_stored_bytes}
    outcome = await services.jobs.run(create(job, **limits, settled=once.settlement(job.id)))
    if outcome == TOO_MANY_JOBS:
        detail = f"this key has {settings.max_unfinished_jobs} unfinished jobs, as many as it may"
        raise ProblemError("too-many-jobs", detail, headers={"Retry-After": "10"})
    if outcome == TOO_MANY_BYTES:
        raise no_room(settings)


def _enqueue(services: Services, job_id: str) -> None:
    try:
        services.queue.send_task(VECTORIZE, [job_id], retry=False)
    except OperationalError as error:
        raise unavailable("the queue cannot be reached") from error


async def _undo(services: Services, job: Job) -> None:
    # In this order: a record that the broker kept, but cannot be asked about now, still has its files.
    try:
        await services.jobs.run(discard(job.id))
        await to_thread.run_sync(storage.delete_folder, services.store, storage.job_folder(job.id))
    except (RedisError, BaseError, OSError) as error:
        logger.warning("job %s: traces are left (%s)", job.id, type(error).__name__)


async def wait(services: Services, job: Job, seconds: float) -> Job:
    """The job as soon as it has finished, or as it is after `seconds` or when the server is to stop."""
    changes = services.changes
    deadline = time.monotonic() + seconds
    async with changes.watch(job.id, progress=False) as changed:
        while not (job.finished or changes.stopping) and (left := deadline - time.monotonic()) > 0:
            changed.clear()
            _, now = await services.jobs.find(job.id)
            if now is None or now.finished:
                return now or job
            job = now
            await _wait(changed, left)
    return job


async def delete(services: Services, job: Job) -> None:
    """Cancel the job if it has not finished, else forget it; either way its files go."""
    retention = services.settings.retention.total_seconds()
    canceled = await services.jobs.run(finish(job.id, "canceled", retention=retention, bytes_stored=0))
    await to_thread.run_sync(storage.delete_folder, services.store, storage.job_folder(job.id))
    if canceled:
        return
    _, now = await services.jobs.find(job.id)
    just_canceled = now is not None and now.status == "canceled" and not job.finished  # by another request
    if not just_canceled:
        await services.jobs.run(retire(job.id))


async def stream(services: Services, job: Job, after: int) -> AsyncIterator[bytes]:
    """Server-sent events: a snapshot, every event numbered above `after`, the final state, the end.

    When the server is to stop, or in an outage of Redis, they end early: clients come back and name the last
    event they have seen.
    """
    snapshot = JobView.of(job).model_dump_json()
    yield format_sse_event(event="snapshot", data_str=snapshot, retry=1000)
    after = min(after, job.last_event)  # a client may name an event that there has not been
    with suppress(RedisError):
        async with services.changes.watch(job.id, progress=True) as changed:
            while True:
                changed.clear()
                events = await services.jobs.events(job.id, after)
                for event in events:
                    after = event.number
                    yield await _encode(services, job, event)
                    if event.kind == "state":
                        return
                if services.changes.stopping:
                    return
                if not events and not await _wait(changed, _PING_SECONDS):
                    _, now = await services.jobs.find(job.id)
                    if now is None or (now.finished and now.last_event <= after):
                        return  # deleted or expired meanwhile, or nothing is to come
                    yield format_sse_event(comment="still here")


async def _encode(services: Services, job: Job, event: Event) -> bytes:
    data = event.data
    if event.kind == "state":
        _, now = await services.jobs.find(job.id)
        shown = JobView.of(now or job)  # one that has expired since is as whole, as far as it is known
        data = (shown if now else shown.model_copy(update={"status": data})).model_dump_json()
    return format_sse_event(event=event.kind, data_str=data, id=str(event.number))


async def _wait(changed: asyncio.Event, seconds: float) -> bool:
    """Whether the event came within `seconds`."""
    try:
        async with asyncio.timeout(seconds):
            await changed.wait()
    except TimeoutError:
        return False
    return True


def fingerprint_of(upload: Upload) -> str:
    """Two uploads with the same fingerprint ask for the same job."""
    parts = (
        upload.image,
        b"" if upload.annotations is None else b"+" + upload.annotations,
        json.dumps(request_of(upload), sort_keys=True).encode(),
        upload.webhook.model_dump_json().encode() if upload.webhook else b"",
    )
    digests = b"".join(hashlib.sha256(part).digest() for part in parts)
    return hashlib.sha256(digests).hexdigest()
