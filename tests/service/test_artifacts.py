from __future__ import annotations

import hashlib
import json

import httpx
import pytest

from tests.broker import client_of
from tests.service.in_process import Jobs
from tests.uploads import png
from worker.artifacts import KINDS
from worker.settings import Settings
from worker.steps import claim, finish, record_key

CONTENT = b"0123456789"


@pytest.fixture
def link(jobs: Jobs) -> str:
    return f"/v1/jobs/{jobs.finished(CONTENT)}/preview.png"


def test_a_finished_job_links_to_all_its_files(api: httpx.Client, jobs: Jobs) -> None:
    job = api.get(f"/v1/jobs/{jobs.finished(CONTENT)}").json()
    assert job["warnings"] == ["a warning"]
    for name, kind in KINDS.items():
        answer = api.get(job["links"][name])
        assert (answer.status_code, answer.content) == (200, CONTENT)
        assert answer.headers["content-type"] == kind.media_type
        assert answer.headers["x-content-type-options"] == "nosniff"
        assert kind.filename in answer.headers["content-disposition"]


def test_before_the_end_there_is_nothing(api: httpx.Client, jobs: Jobs) -> None:
    job_id = jobs.submit()
    for _ in range(2):
        answer = api.get(f"/v1/jobs/{job_id}/result")
        assert (answer.status_code, answer.json()["type"]) == (409, "urn:gcvec:problem:not-ready")
        jobs.records.run(claim(job_id))
    jobs.records.run(finish(job_id, "failed", retention=60))
    answer = api.get(f"/v1/jobs/{job_id}/result")
    assert (answer.status_code, answer.json()["type"]) == (409, "urn:gcvec:problem:no-result")


def test_a_known_file_is_not_sent_again(api: httpx.Client, link: str) -> None:
    tag = api.get(link).headers["etag"]
    assert tag == f'"{hashlib.sha256(CONTENT).hexdigest()}"'
    for known in (tag, f"W/{tag}", f'"other", {tag}', "*"):
        answer = api.get(link, headers={"If-None-Match": known})
        assert (answer.status_code, answer.content, answer.headers["etag"]) == (304, b"", tag)
    assert api.get(link, headers={"If-None-Match": '"other"'}).status_code == 200


@pytest.mark.parametrize(
    ("asked", "start", "stop"),
    [
        ("bytes=0-3", 0, 4),
        ("bytes=8-", 8, 10),
        ("bytes=-3", 7, 10),
        ("bytes=5-99", 5, 10),
        ("bytes=-99", 0, 10),
    ],
)
def test_a_part_is_sent_where_a_part_is_asked_for(
    api: httpx.Client, link: str, asked: str, start: int, stop: int
) -> None:
    answer = api.get(link, headers={"Range": asked})
    assert (answer.status_code, answer.content) == (206, CONTENT[start:stop])
    assert answer.headers["content-range"] == f"bytes {start}-{stop - 1}/10"


@pytest.mark.parametrize(
    "asked",
    ["bytes=0-1,3-4", "lines=0-1", "bytes=", "bytes=-", "bytes=4-2", "bytes=a-b", "bytes=0-" + 5000 * "9"],
)
def test_a_range_that_is_not_one_range_of_bytes_is_ignored(api: httpx.Client, link: str, asked: str) -> None:
    answer = api.get(link, headers={"Range": asked})
    assert (answer.status_code, answer.content) == (200, CONTENT)


@pytest.mark.parametrize("asked", ["bytes=10-", "bytes=11-12", "bytes=-0"])
def test_a_range_outside_is_refused(api: httpx.Client, link: str, asked: str) -> None:
    answer = api.get(link, headers={"Range": asked})
    assert (answer.status_code, answer.headers["content-range"]) == (416, "bytes */10")


def test_a_range_of_another_version_gets_the_whole(api: httpx.Client, link: str) -> None:
    tag = api.get(link).headers["etag"]
    for version, status in ((tag, 206), ('"other"', 200)):
        answer = api.get(link, headers={"Range": "bytes=0-3", "If-Range": version})
        assert answer.status_code == status


@pytest.mark.parametrize("headers", [{}, {"Range": "bytes=0-3"}, {"Range": "bytes=50-"}])
def test_head_tells_without_sending(api: httpx.Client, link: str, headers: dict[str, str]) -> None:
    """Ranges are for GET alone (RFC 9110, 14.2)."""
    answer = api.head(link, headers=headers)
    assert (answer.status_code, answer.content) == (200, b"")
    assert answer.headers["content-length"] == "10"
    assert answer.headers["accept-ranges"] == "bytes"


def test_the_uploaded_picture_is_served_like_all_files(
    api: httpx.Client, jobs: Jobs, settings: Settings
) -> None:
    job_id, photo = jobs.submit(), png()
    link = f"/v1/jobs/{job_id}/image"
    tag = f'"{hashlib.sha256(photo).hexdigest()}"'
    whole = api.get(link)
    assert (whole.content, whole.headers["etag"].removeprefix("W/")) == (photo, tag)
    assert api.get(link, headers={"If-None-Match": tag}).status_code == 304
    head = api.head(link, headers={"Accept-Encoding": "identity"})
    assert (head.status_code, head.content, head.headers["content-length"]) == (200, b"", str(len(photo)))
    part = api.get(link, headers={"Range": "bytes=1-3"})
    assert (part.status_code, part.content) == (206, photo[1:4])
    job = jobs.records.get(job_id)
    assert job is not None
    earlier = {name: value for name, value in job.request.items() if name != "sha256"}
    client_of(settings.broker_url).hset(record_key(job_id), "request", json.dumps(earlier))
    known = api.get(link).headers["etag"]
    assert api.get(link, headers={"If-None-Match": known}).status_code == 304
    api.delete(f"/v1/jobs/{job_id}")
    assert api.get(link).status_code == 410
