"""A thousand clients that look at jobs, a hundred that listen, and a flood of submissions."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable
from statistics import median

import pytest

from benchmarks.load import Answer, Load, flood, listen_all, overheads, poll_all
from tests.fleet import Fleet
from tests.waiting import within

pytestmark = [pytest.mark.service, pytest.mark.slow]

SUBMISSIONS = 500
UNFINISHED = 40
"""So many jobs may wait; what a flood brings beyond that is refused."""


async def clients_of(url: str) -> tuple[list[Answer], Load]:
    answers = await flood(url, SUBMISSIONS)
    jobs = [answer.json()["id"] for answer in answers if answer.status == 202]
    load = Load()
    await asyncio.gather(
        poll_all(url, jobs, load, clients=1000, every=5, seconds=10),
        listen_all(url, jobs, load, clients=100),
    )
    return answers, load


def test_many_clients_meet_no_error_and_lose_nothing(start_fleet: Callable[..., Fleet]) -> None:
    fleet = start_fleet(GCVEC_REQUESTS_PER_MINUTE="0", GCVEC_MAX_UNFINISHED_JOBS=str(UNFINISHED))
    api = fleet.start_api()
    fleet.start_worker()
    answers, load = asyncio.run(clients_of(f"http://127.0.0.1:{api.port}"))
    check_looks(load)
    check_flood(fleet, answers)
    assert "unexpected error" not in api.process.log.read_text()


def check_looks(load: Load) -> None:
    assert set(load.statuses) == {200}
    assert load.statuses[200] >= 1000 + 100
    assert load.ended == 100


def check_flood(fleet: Fleet, answers: list[Answer]) -> None:
    outcomes = Counter(answer.status for answer in answers)
    assert set(outcomes) <= {202, 429, 503}
    assert outcomes[202] >= UNFINISHED
    assert outcomes[429] > 0
    for answer in answers:
        assert "location" in answer.headers or int(answer.headers["retry-after"]) > 0
    ids = {answer.json()["id"] for answer in answers if answer.status == 202}
    assert len(ids) == outcomes[202]
    within(60, lambda: fleet.client.zcard("gcvec:active") == 0)
    assert {fleet.job(job_id).status for job_id in ids} == {"succeeded"}
    assert ids <= {path.split("/")[1] for path in fleet.files()}
    assert len({path.split("/")[1] for path in fleet.files()}) == fleet.client.zcard("gcvec:jobs:anyone")


def test_who_waits_for_a_job_hears_of_its_end_and_not_only_of_the_end_of_the_wait(fleet: Fleet) -> None:
    api = fleet.start_api()
    fleet.start_worker()
    assert median(asyncio.run(overheads(f"http://127.0.0.1:{api.port}", 5))) < 10  # of the 30 they may wait
