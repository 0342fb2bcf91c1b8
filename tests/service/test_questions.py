from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from service.errors import ProblemError
from service.jobs.repository import Changes
from service.jobs.repository import connect as connect_async
from service.questions import Questions
from tests.broker import client_of
from worker.app import EDIT, EXPORT, SHORT_QUEUE, create_celery
from worker.problems import problem
from worker.questions import Answer, give, question_key
from worker.settings import Settings


def asking(settings: Settings, work: Callable[[Questions], Awaitable[Any]]) -> Any:
    async def run() -> Any:
        client = connect_async(settings.broker_url)
        changes = Changes(client)
        listening = asyncio.create_task(changes.listen())
        try:
            return await work(Questions(client, changes, create_celery(settings)))
        finally:
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)
            await client.aclose()

    return asyncio.run(run())


async def answered(settings: Settings, answer: Answer) -> None:
    await asyncio.sleep(0.3)
    await asyncio.to_thread(give, client_of(settings.broker_url), "key", answer)


def test_however_many_ask_the_work_is_done_once(settings: Settings) -> None:
    async def many(questions: Questions) -> list[Any]:
        asked = [questions.ask("key", EXPORT, ["x"], 10) for _ in range(20)]
        *answers, _ = await asyncio.gather(*asked, answered(settings, Answer(5)))
        return answers

    assert asking(settings, many) == [Answer(5)] * 20
    assert client_of(settings.broker_url).llen(SHORT_QUEUE) == 1


def test_a_problem_is_raised(settings: Settings) -> None:
    async def one(questions: Questions) -> None:
        trouble = Answer(problem=problem("unavailable", "no store"))
        await asyncio.gather(questions.ask("key", EXPORT, [], 10), answered(settings, trouble))

    with pytest.raises(ProblemError) as caught:
        asking(settings, one)
    assert caught.value.problem == problem("unavailable", "no store")
    assert "Retry-After" in caught.value.headers


def test_an_answer_that_does_not_come_is_not_awaited_for_ever(settings: Settings) -> None:
    assert asking(settings, lambda questions: questions.ask("key", EXPORT, [], 0.2)) is None
    assert 0 < client_of(settings.broker_url).ttl(question_key("key")) <= 120


def test_an_answer_is_read_as_it_was_given() -> None:
    for answer in (Answer({"a": [1]}), Answer(problem=problem("gone", "away", "/x"))):
        assert Answer.from_json(answer.to_json()) == answer


def test_who_gives_up_asking_alone_takes_the_question_back(settings: Settings) -> None:
    client = client_of(settings.broker_url)

    async def one(questions: Questions) -> Answer | None:
        asked = asyncio.create_task(questions.ask_alone(EDIT, ["x"], 1.0))
        await asyncio.sleep(0.4)
        (key,) = client.keys(question_key("*"))
        assert 0 < client.pttl(key) < 600  # forgotten by itself, were the asker to die, before it gives up
        return await asked

    assert asking(settings, one) is None
    assert client.keys(question_key("*")) == []
    assert client.llen(SHORT_QUEUE) == 1
