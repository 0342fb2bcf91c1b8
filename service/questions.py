"""Asking workers for something short, and waiting for the answer (see `worker.questions`)."""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Sequence
from math import inf
from typing import Any, Final

import redis.asyncio as redis
from anyio import to_thread
from celery import Celery
from kombu.exceptions import OperationalError

from service.errors import ProblemError, unavailable
from service.jobs.repository import Changes
from worker.questions import PENDING, PENDING_SECONDS, Answer, question_key

_LAST_SECONDS: Final = 3.0
"""An answer is awaited so long when the server is to stop, less than it lets requests take."""

_KEPT_SHARE: Final = 0.9


class Questions:
    """Sends short tasks. However many ask the same at a time, the work is done once."""

    def __init__(self, client: redis.Redis, changes: Changes, queue: Celery) -> None:
        self._client: Any = client
        self._changes = changes
        self._queue = queue

    async def ask(
        self, key: str, task: str, args: Sequence[Any], seconds: float, *, kept: float = PENDING_SECONDS
    ) -> Answer | None:
        """The answer to the question `key`, or None if it has not come within `seconds`.

        After `kept` seconds without an answer the question is forgotten.

        Raises ProblemError for an answer that is a problem, and where the queue cannot be reached.
        """
        async with self._changes.listening(f"answer {key}") as heard:
            if await self._client.set(question_key(key), PENDING, nx=True, px=int(1000 * kept)):
                await self._send(key, task, args)
            answer = await self._answer(key, heard, seconds)
        if answer is not None and answer.problem is not None:
            raise ProblemError.of(answer.problem)
        return answer

    async def ask_alone(self, task: str, args: Sequence[Any], seconds: float) -> Answer | None:
        """`ask` for what must not be done twice: who gives up takes the question back, and asks a new one.

        A while before the question is forgotten in any case, so that an answer under way still comes in time.
        """
        key = uuid.uuid4().hex
        try:
            return await self.ask(key, task, args, seconds, kept=seconds * _KEPT_SHARE)
        finally:
            await self._client.delete(question_key(key))

    async def _send(self, key: str, task: str, args: Sequence[Any]) -> None:
        try:
            await to_thread.run_sync(lambda: self._queue.send_task(task, [key, *args], retry=False))
        except OperationalError as error:
            await self._client.delete(question_key(key))
            raise unavailable("the queue cannot be reached") from error

    async def _answer(self, key: str, heard: asyncio.Event, seconds: float) -> Answer | None:
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(seconds) as limit:
                while (text := await self._client.get(question_key(key))) == PENDING:
                    await heard.wait()
                    heard.clear()
                    if self._changes.stopping:
                        limit.reschedule(min(limit.when() or inf, loop.time() + _LAST_SECONDS))
        except TimeoutError:
            return None
        return None if text is None else Answer.from_json(text)
