"""A server that is asked to stop sends away those who wait, and leaves no complaint behind."""

from __future__ import annotations

import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.event_stream import events_of
from tests.fleet import Api, Fleet


@pytest.fixture
def api(tmp_path: Path) -> Iterator[Api]:
    fleet = Fleet(tmp_path)
    yield fleet.start_api()
    fleet.close()


def test_who_waits_for_a_job_is_answered_when_the_server_stops(api: Api) -> None:
    job_id = api.submit()

    def watched() -> list[str]:
        with api.http.stream("GET", f"/v1/jobs/{job_id}/events") as answer:
            return [event["event"] for event in events_of(answer)]

    with ThreadPoolExecutor() as threads:
        waiting = threads.submit(api.http.get, f"/v1/jobs/{job_id}?wait=30")
        watching = threads.submit(watched)
        time.sleep(1)
        api.process.ask_to_stop(seconds=20)  # less than they would wait by themselves
        answer = waiting.result()
        assert watching.result() == ["snapshot"]
    assert answer.status_code == 200
    assert answer.json()["status"] == "queued"
    assert "Traceback" not in api.process.log.read_text()
