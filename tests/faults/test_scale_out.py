"""Several APIs and workers on one broker and one bucket; nothing is kept anywhere else."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import httpx
import obstore
import pytest
from obstore.store import ObjectStore

from tests.browser import Browser
from tests.fleet import ENDLESS, SHORT, Fleet, Process, free_port
from tests.waiting import within
from worker import storage
from worker.orphans import remove_orphans

pytestmark = [pytest.mark.service, pytest.mark.slow]

BUCKET = "s3://gcvec/some/prefix"


@pytest.fixture
def s3(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Process]:
    """An S3 server with an empty bucket, and the environment that leads to it."""
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    command = (sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port))
    server = Process(command, tmp_path / "s3.log", {})
    within(20, lambda: answers(url))
    assert httpx.put(f"{url}/gcvec").status_code == 200
    settings = {"ENDPOINT_URL": url, "ALLOW_HTTP": "true", "REGION": "us-east-1"}
    for name, value in (settings | {"ACCESS_KEY_ID": "key", "SECRET_ACCESS_KEY": "secret"}).items():
        monkeypatch.setenv(f"AWS_{name}", value)
    yield server
    server.kill()


@pytest.fixture
def store(s3: Process) -> ObjectStore:
    return storage.open_store(BUCKET)


def answers(url: str) -> bool:
    try:
        return httpx.get(url).is_success
    except httpx.TransportError:
        return False


def paths(store: ObjectStore) -> list[str]:
    return sorted(entry["path"] for page in obstore.list(store) for entry in page)


def test_two_apis_and_three_workers_are_one_service(
    start_fleet: Callable[..., Fleet], store: ObjectStore
) -> None:
    fleet = start_fleet(GCVEC_STORAGE_URL=BUCKET, GCVEC_REDIRECT_SECONDS="60")
    apis = [fleet.start_api() for _ in range(2)]
    workers = [fleet.start_worker() for _ in range(3)]
    ids = [apis[number % 2].submit(32, number, **SHORT) for number in range(12)]
    for number, job_id in enumerate(ids):
        assert apis[(number + 1) % 2].outcome(job_id)["status"] == "succeeded"
    logs = "".join(worker.log.read_text() for worker in workers)
    assert all(logs.count(f"job {job_id}: attempt 1") == 1 for job_id in ids)
    for api in apis:
        listed = api.http.get("/v1/jobs").json()["jobs"]
        assert [job["id"] for job in listed] == ids[::-1]
        for link, media_type in (("result.gcv", "application/vnd.gcvec"), ("result.svg", "image/svg+xml")):
            answer = api.http.get(f"/v1/jobs/{ids[0]}/{link}")
            assert answer.status_code == 307
            direct = httpx.get(answer.headers["location"])
            assert direct.status_code == 200
            assert direct.headers["content-type"] == media_type
    edits = {"recolors": [{"patch": 0, "color": "#ff0000"}]}
    assert apis[0].http.post(f"/v1/jobs/{ids[0]}/edits", json=edits).status_code == 200
    assert apis[1].http.get(f"/v1/jobs/{ids[0]}/revisions/1/result.gcv").status_code == 307
    before = [path for path in paths(store) if ids[0] not in path]
    assert apis[1].http.delete(f"/v1/jobs/{ids[0]}").status_code == 204
    assert apis[0].http.get(f"/v1/jobs/{ids[0]}").status_code == 410
    assert paths(store) == before
    assert not (fleet.folder / "store").exists()


@pytest.mark.browser
def test_the_page_of_a_job_works_where_downloads_are_redirected(
    start_fleet: Callable[..., Fleet], store: ObjectStore, browser: Browser
) -> None:
    fleet = start_fleet(GCVEC_STORAGE_URL=BUCKET, GCVEC_REDIRECT_SECONDS="60")
    api = fleet.start_api()
    fleet.start_worker()
    job_id = api.submit(24, **SHORT)
    assert api.outcome(job_id)["status"] == "succeeded"
    link = f"/v1/jobs/{job_id}/result"
    assert api.http.get(link).status_code == 307
    for header in ({"Sec-Fetch-Mode": "cors"}, {"X-Requested-With": "fetch"}):
        assert api.http.get(link, headers=header).json()["format"] == "gcvec/1"
    with browser.page(900, 700) as page:
        page.open(f"http://127.0.0.1:{api.port}/v1/jobs/{job_id}/view")
        page.wait_for("window.gcvec", 30)
        assert page.errors == []


def test_a_bucket_that_is_away_fails_jobs_and_refuses_uploads(
    start_fleet: Callable[..., Fleet], s3: Process
) -> None:
    fleet = start_fleet(GCVEC_STORAGE_URL=BUCKET)
    api = fleet.start_api()
    fleet.start_worker()
    job_id = api.submit(**ENDLESS | {"max_points": 250})
    within(20, lambda: fleet.refining(job_id))
    s3.kill()
    failed = api.outcome(job_id, 90)
    assert failed["error"]["type"] == "urn:gcvec:problem:storage-failed"
    for answer in (api.post(**SHORT), api.http.get("/readyz")):
        assert answer.status_code == 503
        assert int(answer.headers["retry-after"]) > 0


def test_what_has_expired_goes_from_a_bucket(start_fleet: Callable[..., Fleet], store: ObjectStore) -> None:
    storage.write(store, "other/file", b"mine")
    fleet = start_fleet(GCVEC_STORAGE_URL=BUCKET, GCVEC_RETENTION="2")
    api = fleet.start_api()
    fleet.start_worker()
    job_id = api.submit(32, **SHORT)
    assert api.outcome(job_id)["status"] == "succeeded"
    within(20, lambda: paths(store) == ["other/file", "redis.id"])


def test_orphans_go_from_a_bucket(fleet: Fleet, store: ObjectStore) -> None:
    storage.write(store, storage.image_path("orphan"), b"x")
    assert remove_orphans(store, fleet.records, 60) == []
    time.sleep(1.1)
    assert remove_orphans(store, fleet.records, 0) == ["orphan"]
    assert paths(store) == []
