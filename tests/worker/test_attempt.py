from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
import time
import uuid

import pytest
import redis

from gcvec.progress import Progress
from tests.broker import client_of
from tests.waiting import within
from worker.attempt import GRACE_SECONDS, REPORT_SECONDS, Attempt
from worker.job import Job
from worker.keeper import StopError
from worker.records import JobRecords, connect
from worker.steps import Call, claim, events_key, finish, lease_key, record_key


class WatchedRecords(JobRecords):
    """Records that know which threads asked them."""

    def __init__(self, client: redis.Redis) -> None:
        super().__init__(client)
        self.askers: list[int] = []

    def run(self, call: Call) -> int:
        self.askers.append(threading.get_ident())
        return super().run(call)


@pytest.fixture
def records(broker_url: str) -> WatchedRecords:
    return WatchedRecords(client_of(broker_url))


@pytest.fixture
def job_id(broker_url: str, records: JobRecords) -> str:
    job = Job(id=uuid.uuid4().hex, owner="me", status="queued", created_at=time.time())
    client_of(broker_url).hset(record_key(job.id), mapping=job.to_fields())
    assert records.run(claim(job.id)) == 1
    return job.id


def iteration(number: int) -> Progress:
    return Progress("refine", 1, 2, number, 10 * number, 3.0, 9.0, 0.1)


def run_until_stopped(attempt: Attempt, seconds: float) -> float:
    started = time.monotonic()
    while time.monotonic() - started < seconds:
        attempt.on_progress(iteration(2))
        time.sleep(0.01)
    return seconds


def test_every_iteration_becomes_an_event(broker_url: str, records: JobRecords, job_id: str) -> None:
    with Attempt(records, job_id, 1, seconds=60, retention=60) as attempt:
        for number in range(1, 31):
            attempt.on_progress(iteration(number))
    client = client_of(broker_url)
    assert client.xlen(events_key(job_id)) == 30
    job = records.get(job_id)
    assert job is not None
    assert job.progress is not None
    assert job.progress["iteration"] == 30


def test_iterations_are_told_of_a_few_times_a_second(
    broker_url: str, records: JobRecords, job_id: str
) -> None:
    def calls() -> int:
        return int(client_of(broker_url).info("commandstats")["cmdstat_evalsha"]["calls"])

    before = calls()
    with Attempt(records, job_id, 1, seconds=60, retention=60) as attempt:
        for number in range(1, 101):
            attempt.on_progress(iteration(number))
            time.sleep(0.01)
    assert 2 <= calls() - before <= 1 / REPORT_SECONDS + 2
    assert client_of(broker_url).xlen(events_key(job_id)) == 100


def test_a_cancelled_job_stops_with_its_next_report(records: WatchedRecords, job_id: str) -> None:
    with Attempt(records, job_id, 1, seconds=60, retention=60) as attempt:
        attempt.on_progress(iteration(1))
        time.sleep(0.3)
        records.run(finish(job_id, "canceled", retention=60))
        asked = len(records.askers)
        with pytest.raises(StopError):
            run_until_stopped(attempt, 20)
        assert len(records.askers) - asked <= 2  # one may have been under way


def test_a_superseded_attempt_stops(broker_url: str, records: JobRecords, job_id: str) -> None:
    with Attempt(records, job_id, 1, seconds=60, retention=60) as attempt:
        client_of(broker_url).delete(lease_key(job_id))
        assert records.run(claim(job_id)) == 2
        with pytest.raises(StopError):
            run_until_stopped(attempt, 5)


def test_the_time_limit_ends_the_job(records: JobRecords, job_id: str) -> None:
    with (
        Attempt(records, job_id, 1, seconds=0.5, retention=60) as attempt,
        pytest.raises(StopError),
    ):
        run_until_stopped(attempt, 5)
    job = records.get(job_id)
    assert job is not None
    assert job.status == "failed"
    assert job.error is not None
    assert job.error["type"] == "urn:gcvec:problem:time-limit"


def test_an_outage_neither_slows_nor_fails_a_run_and_loses_no_event(
    broker_url: str, records: JobRecords, job_id: str
) -> None:
    client = client_of(broker_url)
    nobody = connect("redis://127.0.0.1:1/0", patient=False)
    line = WatchedRecords(nobody)
    with Attempt(line, job_id, 1, seconds=60, retention=60) as attempt:
        for number in range(1, 21):
            attempt.on_progress(iteration(number))
        time.sleep(0.5)
        attempt.check()
        assert client.xlen(events_key(job_id)) == 0
        line._client = client  # the server is back
        within(10, lambda: client.xlen(events_key(job_id)) == 20)
        assert line.askers
        assert threading.get_ident() not in line.askers  # the computation never waited for an answer


def test_no_event_comes_twice_when_an_answer_is_lost(broker_url: str, job_id: str) -> None:
    client = client_of(broker_url)
    unanswered: list[Call] = []

    class LossyLine(JobRecords):
        def run(self, call: Call) -> int:
            answer = super().run(call)
            if client.exists(events_key(job_id)) and not unanswered:
                unanswered.append(call)
                raise redis.TimeoutError
            return answer

    with Attempt(LossyLine(client), job_id, 1, seconds=60, retention=60) as attempt:
        for number in range(1, 6):
            attempt.on_progress(iteration(number))
        within(10, lambda: bool(unanswered))
        for number in range(6, 11):
            attempt.on_progress(iteration(number))
    told = [json.loads(entry["data"])["iteration"] for _, entry in client.xrange(events_key(job_id))]
    assert told == list(range(1, 11))


def test_an_outage_is_told_of_when_it_begins_and_when_it_is_over(
    broker_url: str,
    records: JobRecords,
    job_id: str,
    caplog: pytest.LogCaptureFixture,
) -> None:
    line = JobRecords(connect("redis://127.0.0.1:1/0", patient=False))
    with (
        caplog.at_level("INFO", "worker.attempt"),
        Attempt(line, job_id, 1, seconds=60, retention=60) as attempt,
    ):
        attempt.on_progress(iteration(1))
        time.sleep(5 * REPORT_SECONDS)
        line._client = client_of(broker_url)  # the server is back
        within(10, lambda: len(caplog.messages) > 1)
    assert caplog.messages == [
        f"job {job_id}: progress waits (ConnectionError)",
        f"job {job_id}: progress waits no longer",
    ]


def test_events_that_come_while_others_are_sent_are_not_lost(
    broker_url: str,
    records: JobRecords,
    job_id: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As many wait as may, as after an outage."""
    monkeypatch.setattr("worker.attempt.EVENTS_KEPT", 10)
    client = client_of(broker_url)

    class SlowLine(JobRecords):
        def run(self, call: Call) -> int:
            if not client.exists(events_key(job_id)):
                for number in range(11, 16):
                    attempt.on_progress(iteration(number))
            return super().run(call)

    with Attempt(SlowLine(client), job_id, 1, seconds=60, retention=60) as attempt:
        for number in range(1, 11):
            attempt.on_progress(iteration(number))
        within(3, lambda: client.xlen(events_key(job_id)) == 15)


def test_the_oldest_events_make_room_in_a_long_outage(
    broker_url: str, job_id: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("worker.attempt.EVENTS_KEPT", 10)
    client = client_of(broker_url)
    line = JobRecords(connect("redis://127.0.0.1:1/0", patient=False))
    with Attempt(line, job_id, 1, seconds=60, retention=60) as attempt:
        for number in range(1, 31):
            attempt.on_progress(iteration(number))
            time.sleep(0.02)
        line._client = client  # the server is back
        within(10, lambda: client.xlen(events_key(job_id)) == 10)
    kept = [json.loads(entry["data"])["iteration"] for _, entry in client.xrange(events_key(job_id))]
    assert kept == list(range(21, 31))


STUCK = """
import sys, time
from tests.broker import client_of
from worker.attempt import Attempt
from worker.records import JobRecords

url, job_id = sys.argv[1:]
with Attempt(JobRecords(client_of(url)), job_id, 1, seconds=60, retention=60):
    print("begun", flush=True)
    time.sleep(60)
"""


def test_a_computation_that_does_not_look_up_is_ended(
    broker_url: str, records: JobRecords, job_id: str
) -> None:
    command = (sys.executable, "-c", STUCK, broker_url, job_id)
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as stuck:
        assert stuck.stdout is not None
        assert stuck.stdout.readline() == "begun\n"
        assert records.run(finish(job_id, "canceled", retention=60))
        assert stuck.wait(GRACE_SECONDS + 5) == -signal.SIGKILL
