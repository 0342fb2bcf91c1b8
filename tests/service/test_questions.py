from __future__ import annotations

import asyncio
import time
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from service import questions
from service.errors import ProblemError
from service.jobs.repository import Changes
from service.jobs.repository import connect as connect_async
from service.questions import Questions
from tests.broker import client_of
from worker.app import create_celery
from worker.problems import problem
from worker.questions import FAILED_SECONDS, PENDING, TAKEN, Answer, give, hold, pose, question_key, take
from worker.queues import EDIT, EXPORT, EXPORTS_QUEUE, SHORT_QUEUE
from worker.records import JobRecords
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


async def answered(settings: Settings, answer: Answer, after: float = 0.3) -> None:
    await asyncio.sleep(after)
    records = JobRecords(client_of(settings.broker_url))
    await asyncio.to_thread(
        lambda: [records.run(step) for step in (take("key", "us"), give("key", "us", answer))]
    )


def test_however_many_ask_the_work_is_done_once(settings: Settings) -> None:
    async def many(asker: Questions) -> list[Any]:
        asked = [asker.ask("key", EXPORT, ["x"], 10) for _ in range(20)]
        *answers, _ = await asyncio.gather(*asked, answered(settings, Answer(5)))
        return answers

    assert asking(settings, many) == [Answer(5)] * 20
    assert client_of(settings.broker_url).llen(EXPORTS_QUEUE) == 1


def test_a_problem_is_raised(settings: Settings) -> None:
    async def one(asker: Questions) -> None:
        trouble = Answer(problem=problem("unavailable", "no store"))
        await asyncio.gather(asker.ask("key", EXPORT, [], 10), answered(settings, trouble))

    with pytest.raises(ProblemError) as caught:
        asking(settings, one)
    assert caught.value.problem == problem("unavailable", "no store")
    assert "Retry-After" in caught.value.headers


def test_an_answer_that_does_not_come_is_not_awaited_for_ever(settings: Settings) -> None:
    assert asking(settings, lambda asker: asker.ask("key", EXPORT, [], 0.2)) is None
    assert 0 < client_of(settings.broker_url).pttl(question_key("key")) <= 10_000


def test_a_question_is_there_while_somebody_waits(
    settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(questions, "_KEPT", 300)
    monkeypatch.setattr(questions, "RENEW_SECONDS", 0.1)
    client = client_of(settings.broker_url)

    async def one(asker: Questions) -> None:
        asked = asyncio.create_task(asker.ask("key", EXPORT, [], 1.5))
        await asyncio.sleep(1.2)
        assert client.get(question_key("key")) == PENDING
        assert await asked is None

    asking(settings, one)
    assert client.llen(EXPORTS_QUEUE) == 1
    time.sleep(0.4)
    assert client.get(question_key("key")) is None


def test_what_a_worker_has_not_survived_is_asked_again(
    settings: Settings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(questions, "RENEW_SECONDS", 0.1)
    client = client_of(settings.broker_url)

    async def one(asker: Questions) -> Answer | None:
        asked = asyncio.create_task(asker.ask("key", EXPORT, [], 10))
        await asyncio.sleep(0.3)
        client.set(question_key("key"), TAKEN, px=200)
        answer, _ = await asyncio.gather(asked, answered(settings, Answer(3), after=1.0))
        return answer

    assert asking(settings, one) == Answer(3)
    assert client.llen(EXPORTS_QUEUE) == 2


def test_an_edit_is_asked_once(settings: Settings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(questions, "RENEW_SECONDS", 0.1)
    client = client_of(settings.broker_url)

    async def one(asker: Questions) -> Answer | None:
        asked = asyncio.create_task(asker.ask_alone(EDIT, [], 1.0))
        await asyncio.sleep(0.3)
        client.delete(*client.keys(question_key("*")))
        return await asked

    assert asking(settings, one) is None
    assert client.llen(SHORT_QUEUE) == 1


def test_a_question_whose_answer_was_lost_is_sent_all_the_same(settings: Settings) -> None:
    """The client library asks again, and finds it asked."""
    client, call = client_of(settings.broker_url), pose("key", 10_000)
    ask = client.register_script(call.script)
    assert [ask(keys=call.keys, args=call.args) for _ in range(2)] == [1, 1]
    other = pose("key", 10_000)
    assert ask(keys=other.keys, args=other.args) == 0


def test_who_has_lost_a_question_has_no_say_in_it_any_more(settings: Settings) -> None:
    """But who has taken it and did not hear of that has."""
    client = client_of(settings.broker_url)
    run = JobRecords(client).run
    for worker in ("slow", "next"):
        assert run(pose("key", 10_000)) == 1
        assert [run(take("key", worker)) for _ in range(2)] == [1, 1]
        assert run(take("key", "other")) == 0
        if worker == "slow":
            client.delete(question_key("key"))  # forgotten, and asked again
    client.pexpire(question_key("key"), 1_000)
    assert [run(step) for step in (hold("key", "slow"), give("key", "slow", Answer(1)))] == [0, 0]
    assert client.get(question_key("key")) == TAKEN
    assert client.pttl(question_key("key")) <= 1_000
    assert run(hold("key", "next")) == 1
    assert client.pttl(question_key("key")) > 1_000
    assert run(give("key", "next", Answer(2))) == 1
    assert Answer.from_json(str(client.get(question_key("key")))) == Answer(2)


def test_a_failure_is_known_for_some_seconds_then_tried_again(settings: Settings) -> None:
    """Everybody who asks meanwhile gets to know it, and it is over before they are to come back."""
    client, trouble = client_of(settings.broker_url), Answer(problem=problem("unavailable", "no store"))

    async def several(asker: Questions) -> list[str | None]:
        asked = [asker.ask("key", EXPORT, [], 10) for _ in range(2)]
        first = await asyncio.gather(*asked, answered(settings, trouble), return_exceptions=True)
        late = await asyncio.gather(asker.ask("key", EXPORT, [], 10), return_exceptions=True)
        return [
            error.headers["Retry-After"] for error in (*first[:2], *late) if isinstance(error, ProblemError)
        ]

    retries = asking(settings, several)
    assert client.llen(EXPORTS_QUEUE) == 1
    assert len(retries) == 3
    assert 0 < client.pttl(question_key("key")) <= 1000 * FAILED_SECONDS < 1000 * int(retries[0])


def test_an_answer_is_read_as_it_was_given() -> None:
    for answer in (Answer({"a": [1]}), Answer(problem=problem("gone", "away", "/x"))):
        assert Answer.from_json(answer.to_json()) == answer


def test_who_gives_up_asking_alone_takes_the_question_back(settings: Settings) -> None:
    client = client_of(settings.broker_url)

    async def one(asker: Questions) -> Answer | None:
        asked = asyncio.create_task(asker.ask_alone(EDIT, ["x"], 1.0))
        await asyncio.sleep(0.4)
        (key,) = client.keys(question_key("*"))
        assert 0 < client.pttl(key) <= 10_000  # forgotten by itself, were the asker to die
        await asyncio.sleep(0.55)
        assert client.get(key) is None  # so that an answer under way still comes in time
        assert not asked.done()
        return await asked

    assert asking(settings, one) is None
    assert client.keys(question_key("*")) == []
    assert client.llen(SHORT_QUEUE) == 1
