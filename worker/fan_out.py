"""Shares a picture's parts out over workers. The job's own task stays in charge and works on parts itself.

Requests go to the store and their numbers to Redis; other workers are invited to take some. Nothing is
waited for that the task could not do itself: parts that nobody claims, that somebody claimed and left, and,
when Redis or the store is away, all that are left.
"""

from __future__ import annotations

import logging
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
import redis
from kombu.exceptions import OperationalError
from numpy.typing import NDArray
from obstore.exceptions import BaseError

from gcvec.parts.messages import DamagedPartError, PartRequest, PartResult, request_bytes, result_from
from gcvec.parts.part import refine_part
from gcvec.refinement.scene import Iteration
from worker import storage
from worker.app import app
from worker.attempt import Attempt
from worker.claims import NOTHING, claim_part, end_part, holders_key, open_round, parts_key
from worker.job import Job
from worker.queues import ASSIST, JOBS_QUEUE
from worker.workshop import Workshop

logger = logging.getLogger(__name__)

_LOOK_SECONDS: Final = 0.2


def crew_for(shop: Workshop, job: Job, attempt: Attempt) -> FanOut | None:
    """Who may take part in a job. Nobody while others wait: workers have enough to do, and parts take more
    time than a whole."""
    try:
        return None if shop.progress.client.llen(JOBS_QUEUE) else FanOut(shop, job, attempt)
    except redis.RedisError:
        return None


class FanOut:
    """The crew of one attempt: its own process, and whoever accepts the invitations."""

    def __init__(self, shop: Workshop, job: Job, attempt: Attempt) -> None:
        self.parts = shop.settings.fan_out_parts
        self._shop = shop
        self._job = job
        self._attempt = attempt
        self._round = 0

    def __call__(self, requests: Sequence[PartRequest], pixels: NDArray[np.uint8]) -> Iterator[PartResult]:
        """The results of a round, in the order in which they come. Raises StopError if the run must end."""
        self._round += 1
        waiting = {request.number: request for request in requests}
        own = 0
        try:
            self._share_out(requests)
            while waiting:
                self._attempt.check()
                ready = self._ready(waiting)
                for part, received in ready.items():
                    result = received or refine_part(waiting[part], pixels, self._check)
                    if received is None:
                        own += 1
                        self._note(part)
                    del waiting[part]
                    yield result
                if not ready:
                    time.sleep(_LOOK_SECONDS)
            others = len(requests) - own
            logger.info(
                "job %s: round %d, %d parts, %d by others", self._job.id, self._round, own + others, others
            )
        finally:
            self._clear_away()

    def _share_out(self, requests: Sequence[PartRequest]) -> None:
        """Let others take part; where that fails there is nothing to claim, and nobody else does any."""
        job, seconds = self._job, self._shop.settings.job_seconds
        try:
            for request in requests:
                path = storage.part_path(job.id, job.attempt, self._round, request.number, "request")
                storage.write(self._shop.store, path, request_bytes(request))
            open_round(self._client, job.id, job.attempt, self._round, len(requests), seconds)
            for _ in requests[1:]:
                app.send_task(ASSIST, [job.id, job.attempt, self._round], retry=False)
        except (BaseError, OSError, redis.RedisError, OperationalError) as error:
            logger.warning("job %s: parts are not shared out (%s)", job.id, type(error).__name__)

    def _ready(self, waiting: Mapping[int, PartRequest]) -> dict[int, PartResult | None]:
        """Parts to go on with: what others have made of them, or None where it is for us to do them."""
        job = self._job
        seconds = self._shop.settings.job_seconds
        claim = claim_part(job.id, job.attempt, self._round, uuid.uuid4().hex, seconds)
        try:
            part = self._shop.progress.run(claim)
            if part in waiting:
                return {part: None}
            if part != NOTHING:  # done when Redis was away
                self._note(part)
            key = parts_key(job.id, job.attempt, self._round)
            claimed: Any = self._client.zrange(key, 0, -1)
        except redis.RedisError as error:
            logger.warning("job %s: parts are not shared out (%s)", job.id, type(error).__name__)
            first = min(waiting)
            return {first: self._received(first)}
        return {part: self._received(part) for part in waiting if str(part) not in claimed}

    def _received(self, part: int) -> PartResult | None:
        """What somebody has made of a part; None if it is not there, or not whole."""
        path = storage.part_path(self._job.id, self._job.attempt, self._round, part, "result")
        try:
            return result_from(storage.read(self._shop.store, path))
        except (BaseError, OSError, DamagedPartError) as error:
            logger.warning("job %s: part %d is done again (%s)", self._job.id, part, error)
            return None

    def _note(self, part: int) -> None:
        """Have nobody else take the part any more."""
        try:
            self._shop.progress.run(end_part(self._job.id, self._job.attempt, self._round, part))
        except redis.RedisError:
            logger.warning("job %s: part %d may be done twice", self._job.id, part)

    def _check(self, _: Iteration) -> None:
        self._attempt.check()

    def _clear_away(self) -> None:
        """Remove what was for the others. Who is late removes what it has written itself."""
        job = self._job
        try:
            round_ = job.id, job.attempt, self._round
            self._client.delete(parts_key(*round_), holders_key(*round_))
            storage.delete_folder(self._shop.store, storage.round_folder(job.id, job.attempt, self._round))
        except (BaseError, OSError, redis.RedisError) as error:
            logger.warning("job %s: files of parts stay for now (%s)", job.id, type(error).__name__)

    @property
    def _client(self) -> redis.Redis:
        return self._shop.progress.client
