from __future__ import annotations

import asyncio
import hashlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import aclosing
from typing import Any, NoReturn

import httpx
import pytest
from redis.asyncio import Redis
from redis.exceptions import ConnectionError as RedisConnectionError

from service import idempotency
from service.errors import ProblemError
from service.idempotency import Idempotency
from service.jobs.repository import connect as connect_async
from tests.broker import client_of
from tests.service.in_process import Jobs
from tests.uploads import cvat, png
from worker import steps
from worker.settings import Settings
from worker.steps import STORED, finish

IMAGE = ("a.png", png())


def submit(api: httpx.Client, key: str, **parts: Any) -> httpx.Response:
    files = {"image": parts.get("image", IMAGE)}
    if "annotations" in parts:
        files["annotations"] = ("a.xml", parts["annotations"])
    data = {"options": parts.get("options", "{}")}
    return api.post("/v1/jobs", files=files, data=data, headers={"Idempotency-Key": key})


def test_the_same_request_makes_one_job(api: httpx.Client) -> None:
    first, second = submit(api, "k"), submit(api, "k")
    assert (first.status_code, second.status_code) == (202, 202)
    assert first.json() == second.json()
    assert first.headers["location"] == second.headers["location"]
    assert len(api.get("/v1/jobs").json()["jobs"]) == 1
    assert submit(api, "other").json()["id"] != first.json()["id"]


@pytest.mark.parametrize(
    "change",
    [
        {"image": ("a.png", png(31, 20))},
        {"image": ("b.png", png())},
        {"annotations": cvat()},
        {"options": '{"target_mse": 6}'},
    ],
)
def test_another_request_with_the_key_is_refused(api: httpx.Client, change: dict[str, Any]) -> None:
    assert submit(api, "k").status_code == 202
    answer = submit(api, "k", **change)
    assert (answer.status_code, answer.json()["type"]) == (422, "urn:gcvec:problem:idempotency-mismatch")


def test_a_refused_request_does_not_use_up_its_key(api: httpx.Client) -> None:
    assert submit(api, "k", image=("a.png", b"no picture")).status_code == 415
    assert submit(api, "k").status_code == 202


def test_of_many_at_once_one_makes_the_job(api: httpx.Client) -> None:
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: submit(api, "k"), range(8)))
    assert {answer.status_code for answer in answers} <= {202, 409}
    assert len({answer.json()["id"] for answer in answers if answer.status_code == 202}) == 1
    assert len(api.get("/v1/jobs").json()["jobs"]) == 1
    refused = [answer for answer in answers if answer.status_code == 409]
    assert all(answer.json()["type"] == "urn:gcvec:problem:in-flight" for answer in refused)
    assert all(int(answer.headers["retry-after"]) >= 1 for answer in refused)


def test_a_key_whose_job_was_deleted_says_so(api: httpx.Client, jobs: Jobs) -> None:
    job = submit(api, "k").json()
    api.delete(job["links"]["self"])
    assert submit(api, "k").json()["status"] == "canceled"
    api.delete(job["links"]["self"])
    answer = submit(api, "k")
    assert (answer.status_code, answer.json()["type"]) == (410, "urn:gcvec:problem:gone")


def test_a_key_whose_job_has_expired_says_so(api: httpx.Client, jobs: Jobs) -> None:
    jobs.records.run(finish(submit(api, "k").json()["id"], "succeeded", retention=0))
    answer = submit(api, "k")
    assert (answer.status_code, answer.json()["type"]) == (410, "urn:gcvec:problem:gone")


def test_a_request_that_is_never_finished_blocks_its_key_for_a_minute(settings: Settings) -> None:
    """So it is when an API dies while it handles one."""

    async def run() -> int:
        async with (
            aclosing(connect_async(settings.broker_url)) as client,
            (idempotency := Idempotency(client)).once("me", "k", "print"),
        ):
            with pytest.raises(ProblemError, match="being handled"):
                await idempotency.once("me", "k", "print").__aenter__()
            (name,) = await client.keys("gcvec:once:*")
            return int(await client.ttl(name))

    assert 0 < asyncio.run(run()) <= 60


def sha(script: str) -> str:
    """The name by which a script is called."""
    return hashlib.sha1(script.encode()).hexdigest()


@pytest.fixture
def losing(monkeypatch: pytest.MonkeyPatch) -> Callable[[str, int], None]:
    """Have the first answers of Redis to a command be lost, so many: what it asks for is done."""

    def lose(wanted: str, times: int) -> None:
        left = [times]
        ask = Redis._send_command_parse_response

        async def asked(self: Any, connection: Any, name: str, *args: Any, **named: Any) -> Any:
            answer = await ask(self, connection, name, *args, **named)
            if left[0] and wanted in map(str, args):
                left[0] -= 1
                raise RedisConnectionError("the answer is lost")
            return answer

        monkeypatch.setattr(Redis, "_send_command_parse_response", asked)

    return lose


CLAIM, MAKE, KEEP = "SET", sha(steps._CREATE), sha(idempotency._SETTLE)


@pytest.mark.parametrize(
    ("command", "times", "status"),
    [(CLAIM, 1, 202), (CLAIM, 2, 503), (MAKE, 1, 202), (MAKE, 2, 503), (KEEP, 1, 202), (KEEP, 2, 202)],
)
def test_an_answer_that_is_lost_is_met_at_once(
    api: httpx.Client,
    settings: Settings,
    losing: Callable[[str, int], None],
    command: str,
    times: int,
    status: int,
) -> None:
    """A command is sent again by the client library, and then by the client."""
    jobs = {submit(api, "before").json()["id"]}
    losing(command, times)
    for expected in (status, 202):
        answer = submit(api, "k")
        assert answer.status_code == expected, answer.text
    jobs.add(answer.json()["id"])
    assert {job["id"] for job in api.get("/v1/jobs").json()["jobs"]} == jobs
    assert int(client_of(settings.broker_url).hvals(STORED)[0]) == 2 * len(IMAGE[1])


def test_a_job_whose_creation_was_not_heard_of_is_the_one(
    api: httpx.Client, losing: Callable[[str, int], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Redis was away from then on: what was made could not be taken back, nor the outcome be kept."""

    async def away(*_: object) -> NoReturn:
        raise RedisConnectionError

    submit(api, "before")
    with monkeypatch.context() as outage:
        losing(MAKE, 2)
        outage.setattr(Idempotency, "_settle", away)
        outage.setattr("service.jobs.service._undo", away)
        assert submit(api, "k").status_code == 503
    made, _ = api.get("/v1/jobs").json()["jobs"]
    assert submit(api, "k").json()["id"] == made["id"]
    assert len(api.get("/v1/jobs").json()["jobs"]) == 2
