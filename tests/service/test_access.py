"""API keys: who gets in, and what one key's owner sees of another's."""

from __future__ import annotations

import hashlib
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest
from pydantic import ValidationError

from tests.broker import client_of
from tests.keys import ALICE, BOB, key
from tests.problems import refused
from tests.service.in_process import serving
from tests.uploads import png
from worker.records import JobRecords
from worker.settings import Settings
from worker.steps import claim, finish

IMAGE = {"image": ("a.png", png())}


@pytest.fixture
def keyed(settings: Settings) -> Settings:
    digest = hashlib.sha256(BOB.encode()).hexdigest()
    return Settings(**{**settings.model_dump(), "api_keys": f"{ALICE}, sha256:{digest}"})


@pytest.fixture
def locked(keyed: Settings) -> Iterator[httpx.Client]:
    with serving(keyed) as client:
        yield client


@pytest.mark.parametrize(
    "headers",
    [
        {},
        key("wrong"),
        {"Authorization": "Bearer"},
        key(ALICE + "x"),
        key("sha256:" + hashlib.sha256(ALICE.encode()).hexdigest()),
        {"Authorization": f"Basic {ALICE}"},
        {"Authorization": ALICE},
        {"Authorization": b"Bearer \xff\xfe"},
    ],
)
@pytest.mark.parametrize("path", ["/v1/jobs", "/v1/jobs/x", "/v1/jobs/x/events", "/metrics"])
def test_without_a_key_of_ours_nobody_gets_in(
    locked: httpx.Client, path: str, headers: dict[str, str]
) -> None:
    answer = locked.get(path, headers=headers)
    refused(answer, 401, "unauthorized")
    assert answer.headers["www-authenticate"] == "Bearer"


def test_an_upload_without_a_key_is_refused_before_it_is_read(locked: httpx.Client) -> None:
    host, port = locked.base_url.host, locked.base_url.port
    with socket.create_connection((host, port or 80), timeout=5) as connection:
        connection.sendall(b"POST /v1/jobs HTTP/1.1\r\nHost: x\r\nContent-Length: 1000000\r\n\r\n")
        assert connection.recv(100).startswith(b"HTTP/1.1 401 ")


def test_keys_get_in_and_health_needs_none(locked: httpx.Client) -> None:
    for name in (ALICE, BOB):
        assert locked.get("/v1/jobs", headers=key(name)).status_code == 200
        assert locked.get("/metrics", headers=key(name)).status_code == 200
    assert locked.get("/v1/jobs", headers={"Authorization": f"bearer {ALICE}"}).status_code == 200
    assert locked.get("/livez").status_code == locked.get("/readyz").status_code == 200


def test_metrics_can_be_open(keyed: Settings) -> None:
    with serving(keyed.model_copy(update={"metrics_open": True})) as client:
        assert client.get("/metrics").status_code == 200
        assert client.get("/v1/jobs").status_code == 401


def test_a_foreign_job_is_answered_like_one_that_never_was(locked: httpx.Client, keyed: Settings) -> None:
    job_id = locked.post("/v1/jobs", files=IMAGE, headers=key(ALICE)).json()["id"]
    records = JobRecords(client_of(keyed.broker_url))
    assert records.run(claim(job_id))
    assert records.run(finish(job_id, "succeeded", retention=60))
    paths = ("", "/events", "/result", "/result.svg", "/preview.png", "/revisions/1", "/revisions/1/result")
    for path in paths:
        foreign = locked.get(f"/v1/jobs/{job_id}{path}", headers=key(BOB))
        unknown = locked.get(f"/v1/jobs/{'0' * 32}{path}", headers=key(BOB))
        assert foreign.status_code == unknown.status_code == 404
        assert foreign.content == unknown.content
    for method, path, body in (("DELETE", "", None), ("POST", "/edits", {"moves": []})):
        assert (
            locked.request(method, f"/v1/jobs/{job_id}{path}", json=body, headers=key(BOB)).status_code == 404
        )
    assert locked.get("/v1/jobs", headers=key(BOB)).json()["jobs"] == []
    assert locked.get(f"/v1/jobs/{job_id}", headers=key(ALICE)).status_code == 200
    assert [job["id"] for job in locked.get("/v1/jobs", headers=key(ALICE)).json()["jobs"]] == [job_id]
    assert locked.delete(f"/v1/jobs/{job_id}", headers=key(ALICE)).status_code == 204
    assert locked.get(f"/v1/jobs/{job_id}", headers=key(BOB)).status_code == 404


def test_an_idempotency_key_is_its_owners(locked: httpx.Client) -> None:
    made = [
        locked.post("/v1/jobs", files=IMAGE, headers={**key(name), "Idempotency-Key": "same"}).json()["id"]
        for name in (ALICE, BOB, ALICE)
    ]
    assert made[0] != made[1]
    assert made[0] == made[2]


def test_keys_are_kept_as_digests(keyed: Settings) -> None:
    assert ALICE not in repr(keyed)
    assert all(kept.startswith("sha256:") and len(kept) == 71 for kept in keyed.api_keys)


@pytest.mark.parametrize("bad", ["short", "sha256:12", "sha256:" + "g" * 64])
def test_a_key_that_is_none_is_refused_and_not_repeated(bad: str) -> None:
    with pytest.raises(ValidationError) as error:
        Settings(api_keys=bad)
    assert bad not in str(error.value)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Host": "evil.example"}, 403),
        ({"Host": "evil.example:8000", "Origin": "http://evil.example:8000"}, 403),
        ({"Host": "127.0.0.1.evil.example"}, 403),
        ({"Origin": "https://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "["}, 403),
        ({"Host": ""}, 403),
        ({"Origin": "http://["}, 403),
        ({"Host": "localhost"}, 200),
        ({"Host": "localhost:1", "Origin": "http://localhost:1"}, 200),
        ({"Host": "[::1]:8000"}, 200),
        ({}, 200),
    ],
)
def test_an_open_service_answers_no_other_site(
    api: httpx.Client, headers: dict[str, str], status: int
) -> None:
    assert api.get("/v1/jobs", headers=headers).status_code == status


def test_an_open_service_answers_on_loopback_only(settings: Settings) -> None:
    with serving(settings, host="0.0.0.0") as client:
        assert client.get("/v1/jobs").status_code == 200
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.connect(("192.0.2.1", 9))  # sends nothing: asks which address of ours would be used
            address = probe.getsockname()[0]
        answer = client.get(f"http://{address}:{client.base_url.port}/v1/jobs", headers={"Host": "localhost"})
        refused(answer, 403, "forbidden")


def test_serve_refuses_to_be_open_to_others(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gcvec.cli", "serve", "--host", "0.0.0.0", "--data", str(tmp_path / "d")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30)
    assert done.returncode == 2
    assert "GCVEC_API_KEYS" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_new_key_and_its_digest_belong_together() -> None:
    command = [sys.executable, "-m", "gcvec.cli", "key"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=True)
    made, digest = (line.split()[-1] for line in done.stdout.splitlines())
    assert Settings(api_keys=made).api_keys == Settings(api_keys=digest).api_keys == (digest,)
