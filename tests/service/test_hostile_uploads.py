"""Uploads that are meant to do harm: each is refused with one clear problem, or harmless."""

from __future__ import annotations

import json
import logging
import resource
import select
import socket
import struct
import time
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from io import BytesIO
from pathlib import Path
from typing import Any

import httpx
import pytest

from gcvec.io import read_picture
from service import server
from service.jobs import uploads
from tests.broker import client_of
from tests.problems import refused
from tests.service.in_process import Jobs, files_in, serving
from tests.uploads import cvat, png
from tests.waiting import within
from worker.settings import Settings
from worker.steps import record_key

IMAGE = ("a.png", png())
FORM = "multipart/form-data; boundary=b"
MEGABYTE = 2**20


def chunk(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))


def png_of(width: int, height: int, *chunks: bytes) -> bytes:
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + b"".join(chunks) + chunk(b"IEND", b"")


def deflated_zeros(megabytes: int) -> bytes:
    """What inflates to so much, a thousandth of it in size."""
    packer = zlib.compressobj(9)
    return b"".join(packer.compress(bytes(MEGABYTE)) for _ in range(megabytes)) + packer.flush()


BOMB = deflated_zeros(60)


def archive(*entries: tuple[str, bytes]) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as target:
        for name, content in entries:
            target.writestr(name, content)
    return buffer.getvalue()


def coco(*polygons: list[float]) -> bytes:
    image = {"id": 1, "file_name": "a.png", "width": 30, "height": 20}
    annotations = [{"image_id": 1, "category_id": 1, "segmentation": [polygon]} for polygon in polygons]
    return json.dumps({"images": [image], "categories": [], "annotations": annotations}).encode()


def part(name: str, content: bytes, filename: str | None = None) -> bytes:
    named = "" if filename is None else f'; filename="{filename}"'
    head = f'--b\r\nContent-Disposition: form-data; name="{name}"{named}\r\n\r\n'
    return head.encode("utf-8", "surrogateescape") + content + b"\r\n"


def form(*parts: bytes) -> bytes:
    return b"".join(parts) + b"--b--\r\n"


def post(api: httpx.Client, body: bytes, content_type: str = FORM) -> httpx.Response:
    return api.post("/v1/jobs", content=body, headers={"Content-Type": content_type})


def peak_memory() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


@pytest.mark.parametrize(
    ("picture", "status", "code"),
    [
        (png_of(60_000, 60_000, chunk(b"IDAT", BOMB)), 413, "picture-too-large"),
        (png_of(2**31 - 1, 2**31 - 1), 413, "picture-too-large"),
        (png_of(20, 20, chunk(b"iCCP", b"p\0\0" + BOMB), chunk(b"IDAT", b"")), 422, "unreadable-picture"),
        (png_of(20, 20, chunk(b"zTXt", b"t\0\0" + BOMB), chunk(b"IDAT", b"")), 422, "unreadable-picture"),
    ],
)
def test_a_picture_that_would_burst_is_refused(
    api: httpx.Client, picture: bytes, status: int, code: str
) -> None:
    """The application runs in this process, so its memory is ours."""
    before = peak_memory()
    refused(api.post("/v1/jobs", files={"image": ("a.png", picture)}), status, code)
    assert peak_memory() - before < 30 * MEGABYTE


def test_pixels_beyond_the_picture_are_not_inflated() -> None:
    before = peak_memory()
    picture = read_picture(png_of(20, 20, chunk(b"IDAT", deflated_zeros(200))))
    assert picture.pixels.shape == (20, 20, 3)
    assert peak_memory() - before < 30 * MEGABYTE


@pytest.mark.parametrize(
    ("annotations", "status", "code"),
    [
        (
            b'<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">'
            b'<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;">]><annotations>&c;</annotations>',
            422,
            "unsafe-annotations",
        ),
        (b'<!DOCTYPE a SYSTEM "file:///etc/passwd"><annotations/>', 422, "unsafe-annotations"),
        (archive(("annotations.xml", bytes(60 * MEGABYTE))), 413, "annotations-too-large"),
        (archive(("inner.zip", archive(("annotations.xml", cvat())))), 422, "unsupported-annotations"),
        (archive(("annotations.xml", archive(("a.xml", cvat())))), 422, "unsupported-annotations"),
        (archive(("../annotations.xml", cvat())), 422, "unsafe-annotations"),
        (archive(("annotations.xml", cvat()), ("/etc/cron.d/x", b"")), 422, "unsafe-annotations"),
        (archive(("C:\\annotations.xml", cvat())), 422, "unsafe-annotations"),
        (b"[" * 90_000, 422, "broken-annotations"),
        (b"<annotations>" + b"<a>" * 30_000, 422, "broken-annotations"),
        (cvat(points="nan,0;1,inf;2,2"), 422, "broken-annotations"),
        (coco([float("nan"), 0, 1, 1, 2, 2]), 422, "broken-annotations"),
        (coco([float("inf"), 0, 1, 1, 2, 2]), 422, "broken-annotations"),
    ],
)
def test_annotations_that_would_burst_or_break_out_are_refused(
    api: httpx.Client, tmp_path: Path, annotations: bytes, status: int, code: str
) -> None:
    before = peak_memory()
    answer = api.post("/v1/jobs", files={"image": IMAGE, "annotations": ("a", annotations)})
    refused(answer, status, code)
    assert peak_memory() - before < 60 * MEGABYTE
    assert files_in(tmp_path / "storage") == []


@pytest.mark.parametrize(
    "annotations",
    [
        coco(*([[0, 0, 9, 0, 9, 9]] * 11)),
        coco([0, 0, 9, 0, 9, 9] * 40),
        coco(*([[0, 0, 9, 0, 9, 9] * 30] * 4)),
        cvat(points=";".join(["1,1", "9,1", "9,9"] * 40)),
    ],
)
def test_polygons_beyond_the_limits_are_refused(settings: Settings, annotations: bytes) -> None:
    limits = {"max_polygons": 10, "max_polygon_vertices": 100, "max_vertices": 300}
    with serving(settings.model_copy(update=limits)) as api:
        few = coco(*([[0, 0, 9, 0, 9, 9]] * 10))
        assert api.post("/v1/jobs", files={"image": IMAGE, "annotations": ("a", few)}).status_code == 202
        answer = api.post("/v1/jobs", files={"image": IMAGE, "annotations": ("a", annotations)})
        assert refused(answer, 413, "annotations-too-large")["pointer"]


@pytest.mark.parametrize(
    "name",
    [
        "../../../../etc/passwd",
        "/etc/passwd",
        "..\\..\\boot.ini",
        "a\0b.png",
        "a%0d%0aSet-Cookie: x=1",
        "\u202egnp.exe",
        "\udcff\udcfe.png",
        "CON",
        ".",
        "'; DROP TABLE jobs; --",
        "${jndi:ldap://127.0.0.1/a}",
        "x" * 3_000,
    ],
)
def test_a_picture_may_have_any_name(
    api: httpx.Client, settings: Settings, tmp_path: Path, name: str
) -> None:
    """A name only tells which annotations are meant: no path and no header is made of it."""
    answer = post(api, form(part("image", png(), name), part("annotations", cvat(), name)))
    assert answer.status_code == 202, answer.text
    job_id = answer.json()["id"]
    folder = f"jobs/{job_id}/input"
    assert files_in(tmp_path / "storage") == [f"{folder}/annotations", f"{folder}/image"]
    picture = api.get(f"/v1/jobs/{job_id}/image")
    assert picture.headers["content-disposition"] == "attachment"
    # Nor does a browser show it again without asking whether its user still may see it.
    assert picture.headers["cache-control"] == "private, no-cache"
    assert client_of(settings.broker_url).memory_usage(record_key(job_id)) < 10_000


def test_a_name_as_long_as_a_file_is_refused(api: httpx.Client) -> None:
    refused(post(api, form(part("image", png(), "x" * 90_000))), 400, "invalid-request")


@pytest.mark.parametrize(
    ("options", "pointer"),
    [
        ('{"target_mse": Infinity}', "/options"),
        ('{"snap": -Infinity}', "/options"),
        ('{"target_mse": 1' + "0" * 400 + "}", "/options/target_mse"),
        ('{"max_points": ' + "9" * 5_000 + "}", "/options"),
        ('{"regions": 1e99}', "/options/regions"),
        ('{"image_name": "\\ud800"}', "/options/image_name"),
        ("null", "/options"),
        ('"{}"', "/options"),
    ],
)
def test_numbers_that_are_none_are_refused(api: httpx.Client, options: str, pointer: str) -> None:
    answer = api.post("/v1/jobs", files={"image": IMAGE}, data={"options": options})
    assert refused(answer, 422, "bad-option")["pointer"] == pointer


@pytest.mark.parametrize(
    ("name", "second"),
    [
        ("image", part("image", png(31, 20), "b.png")),
        ("annotations", part("annotations", b"", "b.xml")),
        ("options", part("options", b'{"regions": 3}')),
        ("annotation", part("annotation", cvat(), "a.xml")),
        ("", part("", b"")),
        ("x" * 100, part("x" * 200, b"") * 2),
    ],
)
def test_a_part_that_comes_twice_or_is_not_known_is_refused(
    api: httpx.Client, tmp_path: Path, name: str, second: bytes
) -> None:
    parts = (part("image", png(), "a.png"), part("annotations", cvat(), "a.xml"), part("options", b"{}"))
    problem = refused(post(api, form(*parts, second)), 422, "invalid-request")
    assert problem["pointer"] == f"/{name}"
    assert repr(name) in problem["detail"]
    assert files_in(tmp_path / "storage") == []


@pytest.mark.parametrize(
    ("body", "status"),
    [
        (form(part("image", png(), "a.png"), *(part(f"f{i}", b"") for i in range(1_001))), 400),
        (form(part("image", png(), "a.png"), *(part(f"f{i}", b"", "x") for i in range(1_001))), 400),
        (form(part("image", png(), "a.png"), part("options", b" " * 1_100_000)), 400),
        (form(b"--b\r\n" + b"X: y\r\n" * 20_000 + part("image", png(), "a.png")[5:]), 400),
        (form(b"--b\r\n\r\n" + png()), 400),
        (form(part("image", png())), 422),
        (form(part("image", png(), "a.png"), part("options", b"{}", "options.json")), 422),
        (b"", 422),
        (b"\0" * 1_000, 400),
    ],
)
def test_a_form_of_a_strange_build_is_refused(
    api: httpx.Client, tmp_path: Path, body: bytes, status: int
) -> None:
    refused(post(api, body), status, "invalid-request")
    assert files_in(tmp_path / "storage") == []


@pytest.mark.parametrize(
    ("content_type", "status"),
    [
        ("multipart/form-data", 400),
        ("multipart/form-data; boundary=", 400),
        ("multipart/form-data; boundary=other", 400),
        ("multipart/form-data; boundary=" + "b" * 5_000, 400),
        ("application/x-www-form-urlencoded", 422),
        ("application/json", 422),
        ("text/plain", 422),
        ("", 422),
    ],
)
def test_a_form_needs_its_boundary(api: httpx.Client, content_type: str, status: int) -> None:
    body = form(part("image", png(), "a.png"))
    refused(post(api, body, content_type), status, "invalid-request")


@pytest.mark.parametrize("charset", ["punycode", "PunyCode", '"punycode"', "idna", "utf-16", "hex", "no"])
def test_a_form_is_read_as_utf8_only(api: httpx.Client, charset: str) -> None:
    """Decoding this as punycode would stop every other request for half a minute."""
    body = form(part("image", png(), "a.png"), part("options", b"a" * 1_000_000))
    started = time.monotonic()
    problem = refused(post(api, body, f"{FORM}; charset={charset}"), 422, "invalid-request")
    assert problem["pointer"] == "/header/content-type"
    headers = [("Content-Type", FORM), ("Content-Type", f"{FORM}; charset={charset}")]
    refused(api.post("/v1/jobs", content=body, headers=headers), 422, "invalid-request")
    assert time.monotonic() - started < 20
    whole = form(part("image", png(), "a.png"), part("options", b"{}"))
    assert post(api, whole, f"{FORM}; charset=UTF-8").status_code == 202


BODY = form(part("image", png(), "a.png"))
START = part("image", b"", "a.png")[:-2]
STATED = b"Content-Length: %d\r\n" % len(BODY)


@pytest.mark.parametrize(
    ("head", "body", "answer"),
    [
        (b"Content-Length: 50\r\n", BODY, b"HTTP/1.1 4"),
        (b"Content-Length: -1\r\n", BODY, b"HTTP/1.1 400 "),
        (b"Content-Length: 1e3\r\n", BODY, b"HTTP/1.1 400 "),
        (b"Content-Length: 5\r\n" + STATED, BODY, b"HTTP/1.1 400 "),
        (b"Transfer-Encoding: chunked\r\n", b"zz\r\n" + BODY, b"HTTP/1.1 400 "),
        (b"Transfer-Encoding: gzip\r\n", BODY, b"HTTP/1.1 400 "),
        (b"X: " + b"a" * 200_000 + b"\r\n" + STATED, BODY, b"HTTP/1.1 400 "),
        (b"Content-Length: %d\r\n" % (len(BODY) + 100), BODY, b""),
        (b"Transfer-Encoding: chunked\r\n", b"ffffffffffffffff\r\n" + BODY, b""),
        (b"Transfer-Encoding: chunked\r\n", b"5\r\n--b\r\n", b""),
    ],
)
def test_a_request_of_another_length_than_it_states_makes_no_job(
    api: httpx.Client,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    head: bytes,
    body: bytes,
    answer: bytes,
) -> None:
    """What is no HTTP the server refuses itself; a client that leaves in mid-upload leaves nothing behind."""
    start = b"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: " + FORM.encode() + b"\r\n"
    with socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10) as connection:
        received = b""
        try:
            connection.sendall(start + head + b"\r\n" + body)
            connection.shutdown(socket.SHUT_WR)
            received = connection.recv(1_000)
        except OSError:  # refused before all of it was sent
            assert answer.startswith(b"HTTP/1.1 400")
    assert received.startswith(answer) or not received
    assert api.get("/v1/jobs").json()["jobs"] == []
    assert files_in(tmp_path / "storage") == []
    assert not [record for record in caplog.records if record.levelno >= logging.ERROR]


def test_a_flood_is_refused_before_it_ends(api: httpx.Client) -> None:
    """What a chunk after the limit holds is not awaited, nor is the end."""
    head = f"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: {FORM}\r\n"
    with socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10) as connection:
        connection.sendall(f"{head}Transfer-Encoding: chunked\r\n\r\n".encode())
        connection.sendall(b"%x\r\n" % len(START) + START + b"\r\n")
        for _ in range(20):
            connection.sendall(b"10000\r\n" + b"x" * 65_536 + b"\r\n")
        assert connection.recv(1_000).startswith(b"HTTP/1.1 413 ")


def test_who_dribbles_is_sent_away(api: httpx.Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """However fast it began, and whoever else calls."""
    monkeypatch.setattr(uploads, "_PATIENCE_SECONDS", 0.5)
    head = (
        f"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: {FORM}\r\nContent-Length: 90000\r\n\r\n"
    )
    with socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10) as connection:
        connection.sendall(head.encode() + START + bytes(60_000))
        started = time.monotonic()
        while not select.select([connection], [], [], 0.1)[0]:
            connection.sendall(b"x")
            assert time.monotonic() - started < 5
        received = b"".join(iter(lambda: connection.recv(2_000), b""))
    assert received.startswith(b"HTTP/1.1 408 ")
    assert b"urn:gcvec:problem:too-slow" in received


def test_who_is_slow_but_comes_on_is_waited_for(
    api: httpx.Client, jobs: Jobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "_PATIENCE_SECONDS", 0.5)

    body = form(part("image", png(), "a.png"), part("options", b"{}" + b" " * 1_000))

    def slowly() -> Iterator[bytes]:
        for start in range(0, len(body), 100):
            time.sleep(0.1)
            yield body[start : start + 100]

    answer = api.post("/v1/jobs", content=slowly(), headers={"Content-Type": FORM})
    assert answer.status_code == 202, answer.text
    waited = api.get(f"/v1/jobs/{jobs.submit()}?wait=1")  # nothing more is to come of this request
    assert waited.status_code == 200


def test_a_crowd_of_large_uploads_is_bounded(api: httpx.Client) -> None:
    """Each is small enough, and none has ended: together they are too much."""
    stated = "Content-Length: 1150000\r\n"
    head = f"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Type: {FORM}\r\n{stated}\r\n"
    with ExitStack() as open_ones:
        crowd = [
            open_ones.enter_context(
                socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10)
            )
            for _ in range(12)
        ]
        for connection in crowd:
            connection.sendall(head.encode() + START + bytes(1_100_000))
        within(10, lambda: len(select.select(crowd, [], [], 0)[0]) >= 3)
        time.sleep(0.2)
        answered, _, _ = select.select(crowd, [], [], 0)
        assert 3 <= len(answered) <= 6
        for connection in answered:
            answer = connection.recv(2_000)
            assert answer.startswith(b"HTTP/1.1 503 ")
            assert b"retry-after: 5" in answer.lower()
    assert api.post("/v1/jobs", files={"image": IMAGE}).status_code == 202


@pytest.mark.parametrize(
    ("start", "more"),
    [(b"GET /livez HTTP/1.1\r\nX: ", b"a"), (b"GET /livez HTTP/1.1\r\n", b"X: y\r\n"), (b"GET /", b"a")],
)
def test_headers_without_end_are_refused(api: httpx.Client, start: bytes, more: bytes) -> None:
    with socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10) as connection:
        connection.sendall(start)
        sent = 0
        try:
            while sent < MEGABYTE:
                sent += connection.send(more * (6_000 // len(more)))
                time.sleep(0.001)
        except OSError:  # the server has closed the connection
            pass
        assert sent < MEGABYTE
    assert api.get("/livez").status_code == 200
    assert api.get("/livez", headers={"X": "a" * 60_000}).status_code == 200


@pytest.mark.parametrize("before", [b"", b"GET /livez HTTP/1.1\r\nHost: localhost\r\n\r\n"])
@pytest.mark.parametrize(
    ("start", "more"), [(b"GET /livez HTTP/1.1\r\nX: ", b"a"), (b"", b"\r\n"), (b"G", b"")]
)
def test_headers_that_do_not_come_to_an_end_are_not_awaited(
    api: httpx.Client, monkeypatch: pytest.MonkeyPatch, before: bytes, start: bytes, more: bytes
) -> None:
    monkeypatch.setattr(server, "HEADER_SECONDS", 0.5)
    with socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10) as connection:
        if before:
            connection.sendall(before)
            assert connection.recv(1_000).startswith(b"HTTP/1.1 200 ")
        connection.sendall(start)
        began = time.monotonic()
        try:
            while not select.select([connection], [], [], 0.05)[0] or connection.recv(1_000):
                assert time.monotonic() - began < 10
                connection.sendall(more)
        except OSError:  # the server has closed the connection
            pass


def test_who_says_nothing_is_not_awaited_but_who_has_asked_is(
    api: httpx.Client, jobs: Jobs, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "HEADER_SECONDS", 0.2)
    with socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10) as connection:
        assert connection.recv(1_000) == b""
    assert api.get(f"/v1/jobs/{jobs.submit()}?wait=1").json()["status"] == "queued"


def test_a_request_behind_a_large_body_is_read(api: httpx.Client) -> None:
    """Its first bytes come together with the last ones of a body, which are no headers."""
    large = 200_000
    head = f"POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\nContent-Length: {large}\r\n\r\n".encode()
    following = b"GET /livez HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"
    with socket.create_connection((api.base_url.host, api.base_url.port or 0), timeout=10) as connection:
        connection.sendall(head + bytes(large) + following[:20])
        time.sleep(0.2)
        connection.sendall(following[20:])
        answers = b"".join(iter(lambda: connection.recv(100_000), b""))
    assert b"Headers too large" not in answers
    assert answers.count(b"HTTP/1.1 200 ") == 1


def test_a_large_document_of_edits_is_refused(api: httpx.Client) -> None:
    body: Any = {"moves": [{"curve": 0, "index": 0, "dx": 0, "dy": 0}] * 40_000}
    refused(api.post(f"/v1/jobs/{'0' * 32}/edits", json=body), 413, "too-large")
    deep = b'{"moves": ' + b"[" * 100_000
    answer = api.post(
        f"/v1/jobs/{'0' * 32}/edits", content=deep, headers={"Content-Type": "application/json"}
    )
    refused(answer, 400, "invalid-request")
