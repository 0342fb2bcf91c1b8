"""Webhooks of real jobs: signed, filtered, repeated, and not forgotten when everything dies."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import httpx
import pytest

from tests.fleet import SHORT, Api, Fleet, picture
from tests.waiting import within
from tests.webhook_receiver import SECRET, Receiver, signature_of

pytestmark = [pytest.mark.service, pytest.mark.slow]


@pytest.fixture
def fleet(start_fleet: Callable[..., Fleet]) -> Iterator[Fleet]:
    return start_fleet(GCVEC_WEBHOOK_PRIVATE="true", GCVEC_WEBHOOK_PAUSES="1,1,1")


def submit(api: Api, url: str, **more: Any) -> httpx.Response:
    webhook = {"url": url, "secret": SECRET, **more}
    form = {"options": json.dumps(SHORT), "webhook": json.dumps(webhook)}
    return api.http.post("/v1/jobs", files={"image": ("a.png", picture(24))}, data=form)


def due_in(fleet: Fleet, entry: str) -> float:
    """Seconds until a message is sent again: more than a minute while one is being sent."""
    due = fleet.client.zscore("gcvec:deliveries", entry)
    return float(due or math.inf) - time.time()


def told(receiver: Receiver) -> list[tuple[str, str]]:
    messages = [json.loads(body) for _, body in receiver.calls]
    return [(message["type"], message["data"]["id"]) for message in messages]


def test_a_job_tells_what_it_was_asked_to_tell(fleet: Fleet, receiver: Receiver) -> None:
    api = fleet.start_api()
    fleet.start_worker()
    quiet = submit(api, receiver.url).json()["id"]
    chatty = submit(api, receiver.url, events=["job.started", "job.succeeded"]).json()["id"]
    deaf = submit(api, receiver.url, events=["job.failed"]).json()["id"]
    for job_id in (quiet, chatty, deaf):
        assert api.outcome(job_id)["status"] == "succeeded"
    within(20, lambda: len(receiver.calls) == 3 and fleet.client.zcard("gcvec:deliveries") == 0)
    assert sorted(told(receiver)) == sorted(
        [("job.succeeded", quiet), ("job.started", chatty), ("job.succeeded", chatty)]
    )
    for headers, body in receiver.calls:
        assert headers["webhook-signature"] == signature_of(headers, body)
    assert len({headers["webhook-id"] for headers, _ in receiver.calls}) == 3
    assert SECRET not in api.http.get(f"/v1/jobs/{chatty}").text


def test_a_receiver_that_fails_is_called_again_under_the_same_id(fleet: Fleet, receiver: Receiver) -> None:
    api = fleet.start_api()
    receiver.status = 500
    worker = fleet.start_worker()
    job_id = submit(api, receiver.url).json()["id"]
    within(20, lambda: receiver.calls and due_in(fleet, f"{job_id} succeeded") < 60)
    worker.kill()
    fleet.broker.kill()
    fleet.start_broker()
    fleet.start_worker()
    within(20, lambda: len(receiver.calls) >= 2)
    receiver.status = 200
    within(20, lambda: fleet.client.zcard("gcvec:deliveries") == 0)
    assert set(told(receiver)) == {("job.succeeded", job_id)}
    assert {headers["webhook-id"] for headers, _ in receiver.calls} == {f"msg_{job_id}_succeeded"}


def test_a_receiver_that_never_answers_well_is_given_up(fleet: Fleet, receiver: Receiver) -> None:
    api = fleet.start_api()
    fleet.start_worker()
    receiver.status = 302
    submit(api, receiver.url)
    within(30, lambda: len(receiver.calls) == 4 and fleet.client.zcard("gcvec:deliveries") == 0)
    assert all(headers["host"] == receiver.url.removeprefix("http://") for headers, _ in receiver.calls)


def test_addresses_of_our_own_network_are_refused(
    start_fleet: Callable[..., Fleet], receiver: Receiver
) -> None:
    fleet = start_fleet()
    api = fleet.start_api()
    answer = submit(api, receiver.url)
    assert answer.status_code == 422
    assert answer.json()["type"] == "urn:gcvec:problem:bad-webhook"
    assert answer.json()["pointer"] == "/webhook/url"
    fleet.start_worker()
    assert submit(api, f"https://localhost:{receiver.server_port}").status_code == 202  # known when resolved
    within(20, lambda: fleet.client.hget("gcvec:totals", "finished:succeeded") == "1")
    within(20, lambda: fleet.client.zcard("gcvec:deliveries") == 0)
    assert receiver.calls == []
