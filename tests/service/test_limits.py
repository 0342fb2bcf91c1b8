"""What one owner may ask for and keep."""

from __future__ import annotations

import time
from pathlib import Path

import httpx

from tests.broker import client_of
from tests.keys import ALICE, BOB, key
from tests.problems import refused
from tests.service.in_process import Jobs, files_in, serving
from tests.uploads import png
from worker.records import JobRecords
from worker.settings import Settings
from worker.steps import claim, finish

IMAGE = {"image": ("a.png", png())}


def limited(settings: Settings, **limits: int) -> Settings:
    return Settings(**{**settings.model_dump(), "api_keys": f"{ALICE},{BOB}", **limits})


def stored(settings: Settings) -> dict[str, str]:
    return dict(client_of(settings.broker_url).hgetall("gcvec:stored"))


def test_too_many_requests_of_one_key_are_refused_for_a_while(settings: Settings) -> None:
    with serving(limited(settings, requests_per_minute=60)) as client:
        started = time.monotonic()
        answers = [client.get("/v1/jobs", headers=key(ALICE)) for _ in range(20)]
        refilled = time.monotonic() - started  # one request a second
        late = [answer for answer in answers if answer.status_code != 200]
        assert 9 - refilled <= len(late) <= 10
        refused(late[0], 429, "too-many-requests")
        assert client.get("/v1/jobs", headers=key(BOB)).status_code == 200
        assert client.get("/readyz").status_code == 200
        wait = int(late[-1].headers["retry-after"])
        assert 1 <= wait <= 2
        time.sleep(wait)
        assert client.get("/v1/jobs", headers=key(ALICE)).status_code == 200


def test_too_many_unfinished_jobs_are_refused_and_leave_nothing(settings: Settings, tmp_path: Path) -> None:
    with serving(limited(settings, max_unfinished_jobs=2)) as client:
        first, _ = (client.post("/v1/jobs", files=IMAGE, headers=key(ALICE)).json()["id"] for _ in range(2))
        files = files_in(tmp_path / "storage")
        answer = client.post("/v1/jobs", files=IMAGE, headers=key(ALICE))
        refused(answer, 429, "too-many-jobs")
        assert int(answer.headers["retry-after"]) > 0
        assert files_in(tmp_path / "storage") == files
        assert client.post("/v1/jobs", files=IMAGE, headers=key(BOB)).status_code == 202
        records = JobRecords(client_of(settings.broker_url))
        assert records.run(claim(first))
        assert records.run(finish(first, "succeeded", retention=60))
        assert client.post("/v1/jobs", files=IMAGE, headers=key(ALICE)).status_code == 202


def test_what_a_key_stores_is_bounded(settings: Settings, tmp_path: Path) -> None:
    size = len(png())
    with serving(limited(settings, max_stored_bytes=2 * size + 1)) as client:
        kept = [client.post("/v1/jobs", files=IMAGE, headers=key(ALICE)).json()["id"] for _ in range(2)]
        answer = client.post("/v1/jobs", files=IMAGE, headers=key(ALICE))
        refused(answer, 413, "quota-exceeded")
        assert int(answer.headers["retry-after"]) > 0
        assert client.post("/v1/jobs", files=IMAGE, headers=key(BOB)).status_code == 202
        assert client.delete(f"/v1/jobs/{kept[0]}", headers=key(ALICE)).status_code == 204
        assert client.post("/v1/jobs", files=IMAGE, headers=key(ALICE)).status_code == 202


def test_who_stores_as_much_as_allowed_has_nothing_more_made(settings: Settings) -> None:
    full = Settings(**{**settings.model_dump(), "max_stored_bytes": len(png())})
    with serving(full) as client:
        job = f"/v1/jobs/{Jobs(client, full).finished()}"
        for made in (client.get(f"{job}/result.svg"), client.get(f"{job}/preview.png?scale=2")):
            refused(made, 413, "quota-exceeded")
        refused(
            client.post(f"{job}/edits", json={"recolors": [{"patch": 0, "color": "#102030"}]}),
            413,
            "quota-exceeded",
        )
        assert client.get(f"{job}/preview.png").status_code == 200


def test_stored_bytes_are_counted_up_and_down(api: httpx.Client, jobs: Jobs, settings: Settings) -> None:
    size = len(png())
    canceled, failed, done = jobs.submit(), jobs.submit(), jobs.submit()
    assert stored(settings) == {"anyone": str(3 * size)}
    jobs.records.run(finish(failed, "failed", retention=60))
    jobs.records.run(claim(done))
    jobs.records.run(finish(done, "succeeded", retention=60, bytes_stored=size + 1000))
    api.delete(f"/v1/jobs/{canceled}")
    assert stored(settings) == {"anyone": str(2 * size + 1000)}
    for job_id in (failed, done, canceled):
        api.delete(f"/v1/jobs/{job_id}")
    assert stored(settings) == {"anyone": "0"}
