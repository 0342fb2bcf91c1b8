"""What browsers are told to do with answers."""

from __future__ import annotations

import re

import httpx
import pytest

from tests.problems import refused
from tests.service.in_process import Jobs, serving
from worker import storage
from worker.settings import Settings

SVG = b"<svg xmlns='http://www.w3.org/2000/svg'><script>alert(1)</script></svg>" + b" " * 2000


@pytest.fixture
def drawing(jobs: Jobs) -> str:
    job_id = jobs.finished(b"{}" * 2000)
    storage.write_derived(jobs.store, job_id, 0, "result.svg", SVG)
    return f"/v1/jobs/{job_id}/result.svg"


@pytest.mark.parametrize(
    ("path", "sources"),
    [
        *((path, "'none'") for path in ("/livez", "/v1/jobs", "/v1/jobs/x", "/redoc", "/openapi.json")),
        *((path, "'self'") for path in ("/", "/docs", "/v1/jobs/x/view")),
    ],
)
def test_no_answer_is_guessed_at_framed_or_run(api: httpx.Client, path: str, sources: str) -> None:
    headers = api.get(path).headers
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"
    policy = headers["content-security-policy"]
    assert {f"default-src {sources}", "frame-ancestors 'none'"} <= set(policy.split("; "))
    assert "unsafe" not in policy
    assert "script-src" not in policy


@pytest.mark.parametrize("path", ["/", "/docs", "/v1/jobs/x/view"])
def test_pages_load_what_the_service_has(api: httpx.Client, path: str) -> None:
    """Where there is no internet, too, and no script of others sees what the tab keeps."""
    loaded = re.findall(r'(?:src|href)="([^"]+)"', api.get(path).text)
    assert len(loaded) > 3
    for address in loaded:
        assert address.startswith("/")
        assert api.get(address).status_code == 200, address


def test_a_drawing_opened_by_itself_can_do_nothing(api: httpx.Client, drawing: str) -> None:
    answer = api.get(drawing)
    assert answer.content == SVG
    policy = {part.strip() for part in answer.headers["content-security-policy"].split(";")}
    assert {"default-src 'none'", "sandbox"} <= policy
    assert not any(part.startswith("script-src") for part in policy)
    assert answer.headers["x-content-type-options"] == "nosniff"


def test_text_is_compressed_pictures_and_parts_are_not(api: httpx.Client, jobs: Jobs, drawing: str) -> None:
    answer = api.get(drawing)
    assert answer.headers["content-encoding"] == "gzip"
    assert answer.headers["etag"].startswith('W/"')
    again = api.get(drawing, headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304
    part = api.get(drawing, headers={"Range": "bytes=0-1499"})
    assert (part.status_code, part.content) == (206, SVG[:1500])
    preview = api.get(drawing.replace("result.svg", "preview.png"))
    for whole in (part, preview, api.get(drawing, headers={"Accept-Encoding": "identity"})):
        assert "content-encoding" not in whole.headers
        assert not whole.headers["etag"].startswith("W/")


def test_what_is_compact_by_itself_keeps_its_length(api: httpx.Client, jobs: Jobs) -> None:
    """So a download of it can tell how far it is, and be resumed."""
    job_id = jobs.finished(b"0" * 2000)
    storage.write_derived(jobs.store, job_id, 0, "result.pdf", b"1" * 2000)
    for name in ("result.gcv", "result.pdf", "image"):
        answer = api.get(f"/v1/jobs/{job_id}/{name}", headers={"Accept-Encoding": "gzip"})
        assert answer.status_code == 200
        assert int(answer.headers["content-length"]) == len(answer.content)
        assert "content-encoding" not in answer.headers
        assert not answer.headers["etag"].startswith("W/")


@pytest.mark.parametrize("accepted", ["gzip", "identity"])
@pytest.mark.parametrize(
    "name", ["result.svg", "result", "result.gcv", "preview.png", "view", "/", "/docs", "/style.css"]
)
def test_answers_without_content_have_the_headers_of_those_with_it(
    api: httpx.Client, drawing: str, name: str, accepted: str
) -> None:
    """RFC 9110, 9.3.2 and 15.4.5: the tag is that of what GET would send, the length too if it is told."""
    path = name if name.startswith("/") else drawing.replace("result.svg", name)
    asked = {"Accept-Encoding": accepted}
    whole, head = api.get(path, headers=asked), api.head(path, headers=asked)
    known = api.get(path, headers=asked | {"If-None-Match": whole.headers["etag"]})
    for field in ("etag", "vary", "content-type", "content-encoding"):
        assert head.headers.get(field) == whole.headers.get(field)
    if "content-encoding" in whole.headers:
        assert "content-length" not in head.headers
    else:
        assert int(head.headers["content-length"]) == len(whole.content)
    assert (known.status_code, known.content) == (304, b"")
    for field in ("etag", "cache-control"):
        assert known.headers.get(field) == whole.headers.get(field)
    assert "content-security-policy" not in known.headers  # browsers would put it in place of the page's
    assert whole.headers.get("vary") in (known.headers.get("vary"), None)  # what is short does not vary


def test_what_is_short_is_not_compressed(api: httpx.Client, jobs: Jobs) -> None:
    path = f"/v1/jobs/{jobs.finished(b'{}')}/result"
    for answer in (api.get(path), api.head(path)):
        assert "content-encoding" not in answer.headers
        assert answer.headers["content-length"] == "2"
        assert not answer.headers["etag"].startswith("W/")


@pytest.mark.parametrize(
    ("accepted", "compressed"),
    [
        ("gzip", True),
        ("br, GZIP;q=0.5", True),
        ("deflate;q=0, *", True),
        ("gzip;q=0", False),
        ("gzip; q=0.000, identity", False),
        ("*;q=0", False),
        ("gzip;q=0, *", False),
        ("x-gzipped", False),
        ("", False),
    ],
)
def test_what_is_not_wanted_compressed_is_not(
    api: httpx.Client, drawing: str, accepted: str, compressed: bool
) -> None:
    answer = api.get(drawing, headers={"Accept-Encoding": accepted})
    assert answer.content == SVG
    assert (answer.headers.get("content-encoding") == "gzip") is compressed


def test_pages_of_other_origins_are_let_in_by_setting_only(api: httpx.Client, settings: Settings) -> None:
    asked = {"Origin": "https://app.example", "Access-Control-Request-Method": "POST"}
    assert "access-control-allow-origin" not in api.options("/v1/jobs", headers=asked).headers
    origins = {"cors_origins": "https://app.example, https://b.example", "api_keys": "0123456789abcdef"}
    with serving(Settings(**{**settings.model_dump(), **origins})) as client:
        allowed = client.options(
            "/v1/jobs", headers=asked | {"Access-Control-Request-Headers": "Authorization"}
        )
        assert allowed.status_code == 200
        assert allowed.headers["access-control-allow-origin"] == "https://app.example"
        for name in ("Authorization", "Idempotency-Key", "If-None-Match", "If-Range", "Range"):
            wanted = asked | {"Access-Control-Request-Headers": name}
            assert client.options("/v1/jobs", headers=wanted).status_code == 200
        for refusable in ({"Origin": "https://evil.example"}, {"Access-Control-Request-Headers": "X-Evil"}):
            refused(client.options("/v1/jobs", headers=asked | refusable), 403, "forbidden")
        answer = client.get("/v1/jobs", headers={"Origin": "https://app.example"})
        assert answer.status_code == 401
        assert answer.headers["access-control-allow-origin"] == "https://app.example"
        assert "Retry-After" in answer.headers["access-control-expose-headers"]
        other = client.get("/v1/jobs", headers={"Origin": "https://evil.example"})
        assert "access-control-allow-origin" not in other.headers


def test_the_client_is_served_file_by_file(api: httpx.Client) -> None:
    for path, media_type in (("/gcvec/scene.js", "text/javascript"), ("/favicon.svg", "image/svg+xml")):
        answer = api.get(path)
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith(media_type)
        assert api.head(path).status_code == 200
        again = api.get(path, headers={"If-None-Match": answer.headers["etag"]})
        assert again.status_code == 304
        assert answer.headers["cache-control"] == again.headers["cache-control"] == "no-cache"
    for path in ("/gcvec", "/gcvec/", "/%2e%2e/app.py", "/gcvec/..%2f..%2fapp.py"):
        assert api.get(path).status_code == 404
