"""The tasks: load, compute, store. Whether a job may run, and how it ended, its record decides."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Final, TypeVar

from obstore.exceptions import BaseError

from gcvec.errors import InputError
from worker import logs, storage
from worker.app import app
from worker.artifacts import KINDS
from worker.attempt import Attempt
from worker.job import Job
from worker.keeper import StopError
from worker.problems import Problem, input_problem, problem
from worker.queues import VECTORIZE
from worker.steps import claim, finish
from worker.storage import Manifest, StoredFile
from worker.workshop import Workshop, workshop

logger = logging.getLogger(__name__)
T = TypeVar("T")

_STORE_PAUSES: Final = (0.5, 2.0)


class JobError(Exception):
    """The job has failed for a reason that is not the fault of its input."""

    def __init__(self, reason: Problem) -> None:
        super().__init__(reason.detail)
        self.reason = reason


@app.task(name=VECTORIZE)
def vectorize_job(job_id: str) -> None:
    """Run one attempt of a job, unless it has finished, was cancelled or runs elsewhere."""
    shop = workshop()
    with logs.about(job_id):
        job = shop.records.get(job_id) if shop.records.run(claim(job_id)) else None
        if job is not None:
            _attempt(shop, job)


def _attempt(shop: Workshop, job: Job) -> None:
    """The attempt that has just begun, and how it ends."""
    logger.info("job %s: attempt %d", job.id, job.attempt)
    try:
        manifest = storage.read_manifest(shop.store, job.id) or _run(shop, job)
    except StopError:
        logger.info("job %s: attempt %d stopped", job.id, job.attempt)
        storage.delete_folder(shop.store, storage.attempt_folder(job.id, job.attempt))
    except InputError as error:
        _fail(shop, job, input_problem(error))
    except JobError as error:
        _fail(shop, job, error.reason)
    except MemoryError:
        limit = shop.settings.job_memory_bytes
        _fail(shop, job, problem("memory-limit", f"the job needs more than {limit / 1e9:g} GB of memory"))
    except (BaseError, OSError) as error:  # the store is away, or the worker's own disk is full
        logger.warning("job %s: attempt %d failed: %s", job.id, job.attempt, type(error).__name__)
        _fail(shop, job, problem("storage-failed", "files of the job could not be read or written"))
    except Exception:
        logger.exception("job %s: attempt %d failed", job.id, job.attempt)
        _fail(shop, job, problem("internal-error", "the job failed for a reason that was logged"))
    else:
        _succeed(shop, job, manifest)


def _run(shop: Workshop, job: Job) -> Manifest:
    """Compute and store the results; return the manifest in force, ours or that of a faster attempt."""
    from worker.fan_out import crew_for
    from worker.produce import produce

    settings = shop.settings
    if job.attempt > settings.job_attempts:
        raise JobError(problem("worker-lost", f"given up after {settings.job_attempts} attempts"))
    retention = settings.retention.total_seconds()
    image, annotations = _inputs(shop, job)
    with Attempt(
        shop.progress, job.id, job.attempt, seconds=settings.job_seconds, retention=retention
    ) as attempt:
        crew = crew_for(shop, job, attempt)
        product = produce(image, annotations, job.request, settings, attempt.on_progress, crew)
        files = {name: _store(shop, job, name, data) for name, data in product.artifacts.items()}
        attempt.check()
        manifest = Manifest(job.attempt, files, product.warnings, product.totals)
        if _insist(lambda: storage.commit(shop.store, job.id, manifest)):
            return manifest
    committed = storage.read_manifest(shop.store, job.id)
    if committed is None:
        raise StopError
    return committed


def _inputs(shop: Workshop, job: Job) -> tuple[bytes, bytes | None]:
    try:
        image = storage.read(shop.store, storage.image_path(job.id))
        if not job.request["annotations"]:
            return image, None
        return image, storage.read(shop.store, storage.annotations_path(job.id))
    except FileNotFoundError as error:
        raise JobError(problem("storage-failed", "the uploaded files are missing")) from error


def _store(shop: Workshop, job: Job, name: str, data: bytes) -> StoredFile:
    kind = KINDS[name]
    path = f"{storage.attempt_folder(job.id, job.attempt)}/{kind.filename}"
    return _insist(lambda: storage.write(shop.store, path, data, kind.media_type))


def _insist(step: Callable[[], T]) -> T:
    """The outcome of a step that writes to the store, tried a few times."""
    for pause in _STORE_PAUSES:
        try:
            return step()
        except (BaseError, OSError) as error:
            logger.warning("storing failed, once more: %s", type(error).__name__)
            time.sleep(pause)
    try:
        return step()
    except (BaseError, OSError) as error:
        raise JobError(problem("storage-failed", "the results could not be stored")) from error


def _succeed(shop: Workshop, job: Job, manifest: Manifest) -> None:
    retention = shop.settings.retention.total_seconds()
    ended = finish(
        job.id,
        "succeeded",
        retention=retention,
        warnings=manifest.warnings,
        bytes_stored=job.bytes + manifest.size,
        totals=manifest.totals,
    )
    if not shop.records.run(ended):
        if shop.records.unwanted(job.id):  # while its results were written
            storage.delete_folder(shop.store, storage.job_folder(job.id))
        return
    logger.info("job %s: succeeded in attempt %d", job.id, manifest.attempt)
    for number in range(1, job.attempt + 1):
        if number != manifest.attempt:
            storage.delete_folder(shop.store, storage.attempt_folder(job.id, number))


def _fail(shop: Workshop, job: Job, reason: Problem) -> None:
    retention = shop.settings.retention.total_seconds()
    ended = shop.records.run(finish(job.id, "failed", retention=retention, attempt=job.attempt, error=reason))
    if ended:
        logger.info("job %s: failed: %s", job.id, reason.type)
    first = 1 if ended else job.attempt  # what another attempt has delivered stays
    for number in range(first, job.attempt + 1):
        storage.delete_folder(shop.store, storage.attempt_folder(job.id, number))
