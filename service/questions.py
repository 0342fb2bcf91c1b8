"""Asking workers for something short, and waiting for the answer (see `worker.questions`)."""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Awaitable, Callable, Sequence
from contextlib import suppress
from functools import partial
from math import inf
from typing import Any, Final

import redis.asyncio as redis
from anyio import to_thread
from celery import Celery
from kombu.exceptions import OperationalError

from service.errors import ProblemError, unavailable
from service.jobs.repository import Changes
from worker.questions import KEPT_SECONDS, PENDING, RENEW_SECONDS, TAKEN, Answer, pose, question_key, withdraw
from worker.steps import Call

_LAST_SECONDS: Final = 3.0
"""An answer is awaited so long when the server is to stop, less than it lets requests take."""

_KEPT_SHARE: Final = 0.9
_KEPT: Final = int(1000 * KEPT_SECONDS)


class Questions:
    """Sends short tasks. However many ask the same at a time, the work is done once."""

    def __init__(self, client: redis.Redis, changes: Changes, queue: Celery) -> None:
        self._client: Any = client
        self._changes = changes
        self._queue = queue

    async def ask(self, key: str, task: str, args: Sequence[Any], seconds: float) -> Answer | None:
        """The answer to the question `key`, or None if it has not come within `seconds`.

        Should a worker not survive the question, it is asked again. Raises ProblemError for an answer that is
        a problem, and where the queue cannot be reached.
        """
        return await self._ask(key, task, args, seconds, again=True)

    async def ask_alone(
        self, task: str, args: Sequence[Any], seconds: float, identity: str | None = None
    ) -> Answer | None:
        """`ask` for what must not be done twice: it is asked once, and withdrawn by who gives up.

        A while before, so that an answer under way still comes in time. Who asks again under the same
        `identity` gets the same answer.
        """
        key = identity or uuid.uuid4().hex
        withdrawal = asyncio.create_task(self._withdraw(key, seconds * _KEPT_SHARE))
        try:
            return await self._ask(key, task, args, seconds, again=False)
        finally:
            withdrawal.cancel()
            await self._client.delete(question_key(key))

    async def _ask(
        self, key: str, task: str, args: Sequence[Any], seconds: float, *, again: bool
    ) -> Answer | None:
        pose = partial(self._pose, key, task, args)
        async with self._changes.listening(f"answer {key}") as heard:
            await pose()
            answer = await self._answer(key, heard, seconds, pose if again else None)
        if answer is not None and answer.problem is not None:
            raise ProblemError.of(answer.problem)
        return answer

    async def _pose(self, key: str, task: str, args: Sequence[Any]) -> None:
        """Have the question answered, unless others ask it already."""
        if await self._run(pose(key, _KEPT)):
            await self._send(key, task, args)

    async def _withdraw(self, key: str, seconds: float) -> None:
        await asyncio.sleep(seconds)
        await self._run(withdraw(key))

    async def _run(self, call: Call) -> int:
        return int(await self._client.register_script(call.script)(keys=call.keys, args=call.args))

    async def _send(self, key: str, task: str, args: Sequence[Any]) -> None:
        try:
            await to_thread.run_sync(lambda: self._queue.send_task(task, [key, *args], retry=False))
        except OperationalError as error:
            await self._client.delete(question_key(key))
            raise unavailable("the queue cannot be reached") from error

    async def _answer(
        self, key: str, heard: asyncio.Event, seconds: float, again: Callable[[], Awaitable[None]] | None
    ) -> Answer | None:
        """The answer; a question that is gone without one is posed `again`."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout(seconds) as limit:
                while (text := await self._client.get(question_key(key))) in (PENDING, TAKEN, None):
                    if text == PENDING:
                        await self._client.pexpire(question_key(key), _KEPT)
                    elif text is None and again is not None:
                        await again()
                    await _heard_or_time(heard)
                    if self._changes.stopping:
                        limit.reschedule(min(limit.when() or inf, loop.time() + _LAST_SECONDS))
        except TimeoutError:
            return None
        return Answer.from_json(text)


async def _heard_or_time(heard: asyncio.Event) -> None:
    """Return at the next news, or when it is time to keep a question up."""
    with suppress(TimeoutError):
        async with asyncio.timeout(RENEW_SECONDS):
            await heard.wait()
    heard.clear()
