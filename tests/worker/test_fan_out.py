"""The parts of a picture as its own task shares them out: who does which, and what is left behind."""

from __future__ import annotations

import time
import uuid
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import redis

from gcvec.parts.messages import PartRequest, PartResult, request_from, result_bytes
from tests.gcvec.parts.made import a_request, a_result
from tests.worker.workshops import empty_workshop
from worker import fan_out, storage
from worker.claims import claim_part, end_part, parts_key
from worker.fan_out import FanOut, crew_for
from worker.job import Job
from worker.keeper import StopError
from worker.queues import ASSIST, JOBS_QUEUE
from worker.steps import claim, create
from worker.workshop import Workshop

PIXELS = np.zeros((300, 700, 3), np.uint8)
REQUESTS = [replace(a_request(), number=k) for k in range(3)]
ROUND = 1


class Attempt:
    """An attempt that goes on until it is told otherwise."""

    stopped = False

    def check(self) -> None:
        if self.stopped:
            raise StopError


class Bench:
    """A job that runs, its crew, and a helper who does what a test says, while the task does its own part.

    own      parts that the task has done itself, in order
    invited  what was sent to other workers
    """

    def __init__(self, shop: Workshop, monkeypatch: pytest.MonkeyPatch) -> None:
        self.shop = shop
        self.job = Job(id=uuid.uuid4().hex, owner="me", status="queued", created_at=time.time())
        assert shop.records.run(create(self.job, most_jobs=0, most_bytes=0)) == 1
        assert shop.records.run(claim(self.job.id)) == 1
        self.job = replace(self.job, attempt=1)
        self.attempt: Any = Attempt()
        self.own: list[int] = []
        self.invited: list[tuple[str, list[Any]]] = []
        self.meanwhile: Callable[[], object] = lambda: None
        monkeypatch.setattr(fan_out, "refine_part", self._refine)
        monkeypatch.setattr(fan_out.app, "send_task", self._invite)

    def _refine(
        self, request: PartRequest, pixels: np.ndarray, on_iteration: Callable[[Any], None]
    ) -> PartResult:
        assert pixels is PIXELS
        on_iteration(None)
        self.own.append(request.number)
        meanwhile, self.meanwhile = self.meanwhile, lambda: None
        meanwhile()
        return made(request.number)

    def _invite(self, name: str, arguments: list[Any], **_: Any) -> None:
        self.invited.append((name, arguments))

    def run(self) -> list[int]:
        """A round; the numbers of its results, as they come."""
        crew = FanOut(self.shop, self.job, self.attempt)
        return [result.number for result in crew(REQUESTS, PIXELS)]

    def claim(self, seconds: float = 60.0) -> int:
        """Have another worker claim a part."""
        return self.shop.records.run(claim_part(self.job.id, 1, ROUND, seconds))

    def deliver(self, part: int, data: bytes | None = None) -> None:
        """Have another worker leave the result of a part."""
        path = storage.part_path(self.job.id, 1, ROUND, part, "result")
        storage.write(self.shop.store, path, result_bytes(made(part)) if data is None else data)
        assert self.shop.records.run(end_part(self.job.id, 1, ROUND, part)) == 1

    def assert_clean(self) -> None:
        """Neither files nor claims are left."""
        folder = Path(str(self.shop.store.prefix)) / storage.attempt_folder(self.job.id, 1)
        assert not [path for path in folder.rglob("*") if path.is_file()]
        assert not self.shop.client.exists(parts_key(self.job.id, 1, ROUND))


def made(part: int) -> PartResult:
    return replace(a_result(), number=part)


@pytest.fixture
def bench(broker_url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bench:
    return Bench(empty_workshop(broker_url, tmp_path), monkeypatch)


def test_who_gets_no_help_does_everything(bench: Bench) -> None:
    assert bench.run() == bench.own == [0, 1, 2]
    bench.assert_clean()


def test_one_worker_fewer_than_parts_is_invited(bench: Bench) -> None:
    """The task does a part itself."""
    bench.run()
    assert bench.invited == [(ASSIST, [bench.job.id, 1, ROUND])] * 2


def test_requests_lie_in_the_store_while_they_may_be_claimed(bench: Bench) -> None:
    def look() -> None:
        paths = [storage.part_path(bench.job.id, 1, ROUND, part, "request") for part in range(3)]
        found = [request_from(storage.read(bench.shop.store, path)) for path in paths]
        assert [request.number for request in found] == [0, 1, 2]
        assert bench.shop.client.zcard(parts_key(bench.job.id, 1, ROUND)) == 3

    bench.meanwhile = look
    bench.run()


def test_what_the_task_has_done_nobody_can_claim(bench: Bench) -> None:
    def look() -> None:
        assert bench.shop.client.zrange(parts_key(bench.job.id, 1, ROUND), 0, -1) == ["2", "1"]

    def look_next_time() -> None:
        bench.meanwhile = look

    bench.meanwhile = look_next_time
    assert bench.run() == [0, 1, 2]
    assert bench.meanwhile is not look


def test_what_others_have_done_is_taken_from_them(bench: Bench) -> None:
    def help_out() -> None:
        assert bench.claim() == 1
        bench.deliver(1)

    bench.meanwhile = help_out
    assert sorted(bench.run()) == [0, 1, 2]
    assert bench.own == [0, 2]
    bench.assert_clean()


def test_what_others_still_do_is_waited_for(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """When nothing else is left to do."""
    bench.meanwhile = lambda: [bench.claim(), bench.claim()]
    late = [1, 2]
    monkeypatch.setattr(fan_out.time, "sleep", lambda _: bench.deliver(late.pop()))
    assert bench.run() == [0, 2, 1]
    assert bench.own == [0]


def test_what_others_have_left_is_done_by_the_task(bench: Bench) -> None:
    """Their claim has run out."""
    bench.meanwhile = lambda: bench.claim(seconds=-1.0)
    assert sorted(bench.run()) == [0, 1, 2]
    assert sorted(bench.own) == [0, 1, 2]


@pytest.mark.parametrize("kept", [0, 2, 1000])
def test_a_result_that_is_not_whole_is_made_again(bench: Bench, kept: int) -> None:
    def help_badly() -> None:
        assert bench.claim() == 1
        bench.deliver(1, result_bytes(made(1))[:kept])

    bench.meanwhile = help_badly
    assert sorted(bench.run()) == [0, 1, 2]
    assert sorted(bench.own) == [0, 1, 2]
    bench.assert_clean()


def test_without_the_store_the_task_does_everything(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise OSError

    monkeypatch.setattr(storage, "write", fail)
    assert sorted(bench.run()) == sorted(bench.own) == [0, 1, 2]
    assert bench.invited == []


def test_without_redis_the_task_does_everything(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    """From the middle of a round on, save what a helper has delivered."""

    def go_away() -> None:
        assert bench.claim() == 1
        bench.deliver(1)

        def fail(*_: Any) -> None:
            raise redis.ConnectionError

        monkeypatch.setattr(bench.shop.progress, "run", fail)

    bench.meanwhile = go_away
    assert bench.run() == [0, 1, 2]
    assert bench.own == [0, 2]


def test_a_round_that_has_to_stop_leaves_nothing(bench: Bench) -> None:
    def cancel() -> None:
        bench.attempt.stopped = True

    bench.meanwhile = cancel
    with pytest.raises(StopError):
        bench.run()
    assert bench.own == [0]
    bench.assert_clean()


def test_rounds_are_told_apart(bench: Bench) -> None:
    """A worker that is late has nothing of the next."""
    crew = FanOut(bench.shop, bench.job, bench.attempt)
    for _ in range(2):
        list(crew(REQUESTS, PIXELS))
    assert {arguments[2] for _, arguments in bench.invited} == {1, 2}


def test_nobody_is_asked_while_jobs_wait(bench: Bench) -> None:
    assert crew_for(bench.shop, bench.job, bench.attempt) is not None
    bench.shop.client.lpush(JOBS_QUEUE, "a message")
    assert crew_for(bench.shop, bench.job, bench.attempt) is None


def test_nobody_is_asked_without_redis(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: Any) -> None:
        raise redis.ConnectionError

    monkeypatch.setattr(bench.shop.client, "llen", fail)
    assert crew_for(bench.shop, bench.job, bench.attempt) is None


def test_a_crew_divides_a_picture_as_the_settings_say(bench: Bench) -> None:
    assert FanOut(bench.shop, bench.job, bench.attempt).parts == bench.shop.settings.fan_out_parts
