"""The task that takes part in the job of another worker.

Nothing depends on its message: what is claimed and not done others take over. Until it ends it is not
acknowledged, so that its worker fetches no job that it could not begin.
"""

from __future__ import annotations

import logging
import uuid
from functools import lru_cache
from typing import Any

import redis
from obstore.exceptions import BaseError

from worker import logs, storage
from worker.app import app
from worker.attempt import RENEW_SECONDS
from worker.claims import NOTHING, claim_part, end_part, renew_part
from worker.job import Job
from worker.keeper import Keeper, StopError
from worker.queues import ASSIST, JOBS_QUEUE
from worker.records import JobRecords
from worker.workshop import Workshop, workshop

logger = logging.getLogger(__name__)


@app.task(name=ASSIST, reject_on_worker_lost=False)
def assist(job_id: str, attempt: int, number: int) -> None:
    """Work on parts of a job's round `number` until none is left, or jobs wait that nobody works on."""
    shop = workshop()
    with logs.about(job_id):
        try:
            job = shop.progress.get(job_id)
            while job is not None and not shop.progress.client.llen(JOBS_QUEUE):
                token = uuid.uuid4().hex
                part = shop.progress.run(claim_part(job_id, attempt, number, token))
                if part == NOTHING:
                    return
                _do_part(shop, job, attempt, number, part, token)
        except StopError:
            logger.info("job %s: no longer assisted", job_id)
        except (BaseError, OSError, MemoryError, redis.RedisError) as error:
            logger.warning("job %s: not assisted (%s)", job_id, type(error).__name__)
        except Exception:
            logger.exception("job %s: not assisted", job_id)


def _do_part(shop: Workshop, job: Job, attempt: int, number: int, part: int, token: str) -> None:
    """Leave the result of a part in the store, unless it is no longer wanted by then."""
    from gcvec.parallel import use_workers
    from gcvec.parts.messages import request_from, result_bytes
    from gcvec.parts.part import refine_part
    from worker.produce import threads

    logger.info("job %s: round %d, part %d, assists attempt %d", job.id, number, part, attempt)
    with _Claim(shop.progress, job.id, attempt, number, part, token) as claim:
        path = storage.part_path(job.id, attempt, number, part, "request")
        request = request_from(storage.read(shop.store, path))
        use_workers(threads(job.request, shop.settings))
        data = result_bytes(refine_part(request, _photo(job.id), lambda _: claim.check()))
        claim.check()
    path = storage.part_path(job.id, attempt, number, part, "result")
    first = storage.write_once(shop.store, path, data)
    if shop.records.run(end_part(job.id, attempt, number, part)):
        logger.info("job %s: round %d, part %d done for attempt %d", job.id, number, part, attempt)
        return
    logger.info("job %s: round %d, part %d is no longer wanted", job.id, number, part)
    if first:
        storage.delete(shop.store, path)


@lru_cache(maxsize=1)
def _photo(job_id: str) -> Any:
    """The uploaded picture; the last one is kept for the parts that follow."""
    from worker.produce import read_photo

    shop = workshop()
    job = shop.progress.get(job_id)
    if job is None:
        raise StopError
    return read_photo(storage.read(shop.store, storage.image_path(job_id)), job.request, shop.settings).pixels


class _Claim(Keeper):
    """A claim that is renewed while the part is worked on."""

    def __init__(
        self, records: JobRecords, job_id: str, attempt: int, number: int, part: int, token: str
    ) -> None:
        super().__init__("claim")
        self._records = records
        self._renewal = job_id, attempt, number, part, token
        self._outage = logs.Outage(
            logger, f"job {job_id}: claim not renewed", f"job {job_id}: claim renewed again"
        )

    def _keep(self) -> None:
        while not self._done.wait(RENEW_SECONDS):
            try:
                still_ours = self._records.run(renew_part(*self._renewal))
            except redis.RedisError as error:
                self._outage.goes_on(error)
                continue
            self._outage.is_over()
            if not still_ours:
                self._stopped.set()
