"""What API and workers log while things go wrong: about which job, and nothing that is secret."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import pytest

from tests.fleet import SHORT, Fleet, Process, picture
from tests.waiting import within
from tests.webhook_receiver import SECRET, Receiver

pytestmark = [pytest.mark.service, pytest.mark.slow]

KEY, WRONG = "a-key-0123456789abcdef", "wrong-0123456789abcdef"
NAME = "holiday-of-alice.png"


def records(process: Process) -> list[dict[str, Any]]:
    lines = process.log.read_text().splitlines()
    return [json.loads(line) for line in lines if line.startswith("{")]


def test_logs_tell_of_jobs_and_of_no_secrets(start_fleet: Callable[..., Fleet], receiver: Receiver) -> None:
    settings = {"API_KEYS": KEY, "LOG_FORMAT": "json", "WEBHOOK_PRIVATE": "true", "WEBHOOK_PAUSES": "1"}
    fleet = start_fleet(**{f"GCVEC_{name}": value for name, value in settings.items()})
    api = fleet.start_api()
    worker = fleet.start_worker(largest_file=20_000)
    receiver.status = 500

    def post(key: str, side: int) -> Any:
        webhook = json.dumps({"url": f"{receiver.url}/?token={SECRET[6:]}", "secret": SECRET})
        return api.http.post(
            "/v1/jobs",
            files={"image": (NAME, picture(side))},
            data={"options": json.dumps(SHORT), "webhook": webhook},
            headers={"Authorization": f"Bearer {key}"},
        )

    assert post(WRONG, 24).status_code == 401
    done, failed = (post(KEY, side).json()["id"] for side in (24, 96))
    within(30, lambda: fleet.job(failed).status == "failed")
    within(10, lambda: receiver.calls)
    fleet.broker.kill()
    assert post(KEY, 24).status_code == 503
    fleet.start_broker()
    within(20, lambda: post(KEY, 24).status_code == 202)

    told = {record.get("job"): record["message"] for record in records(worker) if record["level"] == "info"}
    assert {done, failed} <= set(told)
    assert {record["message"] for record in records(api.process)} & {"broker: ConnectionError"}
    password = urlsplit(fleet.broker_url).password
    assert password is not None
    for process in (api.process, worker):
        text = process.log.read_text()
        for secret in (KEY, WRONG, SECRET[6:], password, str(fleet.folder), NAME):
            assert secret not in text
