"""What `gcvec submit` says when something is wrong: one line that names the file, or the service."""

from __future__ import annotations

import io
import json
import socket
import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NoReturn

import httpx
import pytest
from redis.exceptions import RedisError

from gcvec.cli._app import run
from service import client
from service.jobs.repository import JobRepository
from tests.broker import client_of
from tests.servers import in_background
from tests.service.in_process import Jobs, serving
from tests.uploads import cvat, png
from worker import storage
from worker.job import Job
from worker.problems import problem
from worker.records import JobRecords
from worker.settings import Settings
from worker.steps import ACTIVE, finish

POLYGON = cvat(points="1,1;x,1;20,15")
KEY = "0123456789abcdef"
PHOTO = client.NamedFile("photo.png", png())


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "photo.png").write_bytes(png())
    (tmp_path / "notes.png").write_text("no picture")
    (tmp_path / "other.xml").write_bytes(cvat(width=31))
    (tmp_path / "broken.xml").write_bytes(POLYGON)
    return tmp_path


def annotating(*names: str) -> bytes:
    """Annotations of several pictures."""
    images = (cvat(name).decode().partition("</version>")[2] for name in names)
    return f"<annotations>{''.join(images).replace('</annotations>', '')}</annotations>".encode()


def interrupt(_: float) -> NoReturn:
    raise KeyboardInterrupt


def said(capsys: pytest.CaptureFixture[str], url: str, *arguments: str, code: int = 2) -> str:
    assert run(["submit", *arguments, "--url", url, "-o", "out"]) == code
    (line,) = capsys.readouterr().err.splitlines()
    return line


@pytest.mark.parametrize(
    ("arguments", "start", "end"),
    [
        (["notes.png"], "notes.png: ", ""),
        (["photo.png", "-a", "other.xml"], "other.xml: ", ""),
        (["photo.png", "-a", "broken.xml"], "broken.xml: polygon 1, line 1: ", ""),
        (["photo.png", "--target-mse", "-1"], "target_mse must be above 0", ", not -1.0"),
        (["photo.png", "--effort", "11"], "effort must lie between 1 and 9, not 11", ""),
        (
            ["photo.png", "--matte", "white"],
            "Invalid value for '--matte': 'white' is not #rrggbb, such as #ffffff",
            "",
        ),
    ],
)
def test_what_is_wrong_is_named_once(
    api: httpx.Client,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    start: str,
    end: str,
) -> None:
    url = str(api.base_url)
    line = said(capsys, url, *arguments)
    assert line.startswith(f"gcvec: {start.replace('URL', url)}")
    assert line.endswith(end)
    assert line.count("polygon 1") <= 1
    assert "(/" not in line.removesuffix(end)


@pytest.mark.parametrize(
    ("arguments", "said_of_it"),
    [
        ([], "URL: the service asks for an API key: --key or GCVEC_API_KEY"),
        (["--key", "another"], "URL: the service does not know this API key: --key or GCVEC_API_KEY"),
        (["--key", "sécret"], "Invalid value for '--key' (env var: 'GCVEC_API_KEY'): an API key has no such"),
        (["--key", f"{KEY}\n"], "notes.png: unsupported picture"),
    ],
)
def test_a_key_that_does_not_do_is_asked_for(
    settings: Settings,
    folder: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    arguments: list[str],
    said_of_it: str,
) -> None:
    monkeypatch.delenv("GCVEC_API_KEY", raising=False)
    with serving(Settings(**{**settings.model_dump(), "api_keys": KEY})) as api:
        url = str(api.base_url)
        line = said(capsys, url, "notes.png", *arguments)
    assert line.startswith(f"gcvec: {said_of_it.replace('URL', url)}")
    assert "sécret" not in line


def test_another_program_at_the_address_is_no_service(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    class Files(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            """Say nothing."""

        def do_POST(self) -> None:
            self.send_error(404)

    server = ThreadingHTTPServer(("127.0.0.1", 0), Files)
    url = f"http://127.0.0.1:{server.server_port}/there"
    with in_background(server):
        assert said(capsys, url, "photo.png") == f"gcvec: {url}: no gcvec service answers there (HTTP 404)"


@pytest.mark.parametrize("url", ["foo", "127.0.0.1:8000", "ftp://127.0.0.1", "http://", "http://[::1"])
def test_an_address_that_is_none_is_bad_input(
    folder: Path, capsys: pytest.CaptureFixture[str], url: str
) -> None:
    assert repr(url) in said(capsys, url, "photo.png")
    assert not (folder / "out").exists()


def test_no_file_of_the_users_is_written_over(
    api: httpx.Client, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "out").mkdir()
    picture = folder / "out" / "preview.png"
    picture.write_bytes(png())
    line = said(capsys, str(api.base_url), "out/preview.png")
    assert line == "gcvec: out/preview.png: would be written over another file of this command"
    assert picture.read_bytes() == png()
    assert api.get("/v1/jobs").json()["jobs"] == []


@pytest.mark.parametrize(
    ("picture", "regions", "of_stdin"), [("-", "own.xml", "photo.png"), ("photo.png", "-", "own.xml")]
)
def test_stdin_is_sent_as_a_file_is(
    settings: Settings,
    folder: Path,
    sent: Callable[..., Job],
    monkeypatch: pytest.MonkeyPatch,
    picture: str,
    regions: str,
    of_stdin: str,
) -> None:
    (folder / "own.xml").write_bytes(cvat("photo.png"))
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO((folder / of_stdin).read_bytes())))
    job = sent(picture, "-a", regions)
    assert job.request["picture_name"] == picture
    store = storage.open_store(settings.storage)
    assert storage.read(store, storage.image_path(job.id)) == (folder / "photo.png").read_bytes()
    assert storage.read(store, storage.annotations_path(job.id)) == (folder / "own.xml").read_bytes()


def test_what_is_wrong_with_stdin_is_named_so(
    api: httpx.Client, folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stdin", io.TextIOWrapper(io.BytesIO(b"no picture")))
    assert said(capsys, str(api.base_url), "-").startswith("gcvec: -: unsupported picture")
    assert said(capsys, str(api.base_url), "-", "-a", "-") == "gcvec: -: stdin is read for one file only"


def test_an_option_that_has_no_effect_is_named(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["submit", "photo.png", "--snap", "3", "--url", "http://127.0.0.1:1", "-o", "out"]) == 1
    warning, _ = capsys.readouterr().err.splitlines()
    assert warning == "gcvec: warning: photo.png: --snap has no effect: there are no annotations"


@pytest.mark.parametrize(
    ("picture", "arguments", "image_name"),
    [
        ("photo.png", [], "test/photo.png"),
        ("../train/photo.png", [], "train/photo.png"),
        ("../other.png", [], None),
        ("photo.png", ["--image-name", "other.png"], "other.png"),
    ],
)
def test_folders_tell_images_of_one_name_apart_and_stay_at_home(
    folder: Path,
    sent: Callable[..., Job],
    monkeypatch: pytest.MonkeyPatch,
    picture: str,
    arguments: list[str],
    image_name: str | None,
) -> None:
    (folder / "all.xml").write_bytes(annotating("train/photo.png", "test/photo.png", "other.png"))
    (folder / "other.png").write_bytes(png())
    for name in ("train", "test"):
        (folder / name).mkdir()
        (folder / name / "photo.png").write_bytes(png())
    monkeypatch.chdir(folder / "test")
    job = sent(picture, "-a", "../all.xml", *arguments)
    assert job.request["image_name"] == image_name
    assert job.request["picture_name"] == Path(picture).name


def test_folders_that_do_not_tell_images_apart_leave_it_to_the_service(
    api: httpx.Client, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "two.xml").write_bytes(annotating("a/photo.png", "b/photo.png"))
    line = said(capsys, str(api.base_url), "photo.png", "-a", "two.xml")
    assert line.startswith("gcvec: two.xml: several images match 'photo.png'")


def test_a_name_that_is_no_text_is_sent_as_one(api: httpx.Client, settings: Settings, folder: Path) -> None:
    with client.Client(str(api.base_url)) as asking:
        asking.submit(client.NamedFile("odd\udcff.png", png()), client.NamedFile("odd\udcff.xml", cvat()), {})
    job = JobRecords(client_of(settings.broker_url)).get(job_of(settings))
    assert job is not None
    assert job.request["picture_name"] == "odd\ufffd.png"


@pytest.fixture
def meanwhile(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[float], None]], None]:
    """Have something done where the client would pause for so many seconds."""
    return lambda step: monkeypatch.setattr(client, "time", SimpleNamespace(sleep=step))


@pytest.fixture
def sent(
    api: httpx.Client,
    settings: Settings,
    meanwhile: Callable[..., None],
    monkeypatch: pytest.MonkeyPatch,
) -> Callable[..., Job]:
    """Submit with some arguments, without waiting for the end; the job that was made of it."""

    def submit(*arguments: str) -> Job:
        monkeypatch.setattr(JobRepository, "find", nowhere)
        meanwhile(interrupt)
        assert run(["submit", *arguments, "--url", str(api.base_url), "-o", "out"]) == 130
        job = JobRecords(client_of(settings.broker_url)).get(job_of(settings))
        assert job is not None
        return job

    return submit


async def nowhere(*_: object) -> NoReturn:
    raise RedisError


def job_of(settings: Settings) -> str:
    (job_id,) = client_of(settings.broker_url).zrange(ACTIVE, 0, -1)
    return str(job_id)


def test_a_service_that_is_away_for_a_while_is_asked_again(
    api: httpx.Client,
    settings: Settings,
    folder: Path,
    meanwhile: Callable[..., None],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    find, asked, pauses = JobRepository.find, [], []

    async def find_the_third_time(self: JobRepository, job_id: str) -> Any:
        asked.append(job_id)
        if len(asked) <= 2:
            raise RedisError
        return await find(self, job_id)

    def end(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 2:
            reason = problem("time-limit", "it ran too long")
            JobRecords(client_of(settings.broker_url)).run(
                finish(job_of(settings), "failed", retention=60, error=reason)
            )

    monkeypatch.setattr(JobRepository, "find", find_the_third_time)
    meanwhile(end)
    line = said(capsys, str(api.base_url), "photo.png", code=1)
    assert line == f"gcvec: {api.base_url}/v1/jobs/{asked[0]}: it ran too long"
    assert pauses == [5, 5]


def test_a_service_that_stays_away_is_given_up(
    api: httpx.Client,
    settings: Settings,
    folder: Path,
    meanwhile: Callable[..., None],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(JobRepository, "find", nowhere)
    meanwhile(lambda _: None)
    line = said(capsys, str(api.base_url), "photo.png", code=1)
    assert line == f"gcvec: {api.base_url}/v1/jobs/{job_of(settings)}: the job records cannot be reached"


def test_who_interrupts_learns_where_the_job_is(
    api: httpx.Client,
    settings: Settings,
    folder: Path,
    meanwhile: Callable[..., None],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(JobRepository, "find", nowhere)
    meanwhile(interrupt)
    line = said(capsys, str(api.base_url), "photo.png", code=130)
    assert line.endswith(f"{api.base_url}/v1/jobs/{job_of(settings)}")


def test_who_has_too_many_jobs_sends_one_more_later(
    settings: Settings, folder: Path, meanwhile: Callable[..., None]
) -> None:
    def cancel(seconds: float) -> None:
        pauses.append(seconds)
        assert api.delete(f"/v1/jobs/{first}").status_code == 204

    pauses: list[float] = []
    meanwhile(cancel)
    with serving(settings.model_copy(update={"max_unfinished_jobs": 1})) as api:
        first = Jobs(api, settings).submit()
        with client.Client(str(api.base_url)) as asking:
            second = asking.submit(PHOTO, None, {})
        assert pauses == [10]
        assert [job["id"] for job in api.get("/v1/jobs").json()["jobs"]] == [second["id"], first]


def test_an_upload_that_was_too_slow_or_found_no_room_is_sent_again(
    folder: Path, meanwhile: Callable[..., None]
) -> None:
    """Under the same key, so that it is one job."""

    class Passing(BaseHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            """Say nothing."""

        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            keys.append(self.headers["Idempotency-Key"])
            refusals = (problem("too-slow", "slow"), problem("unavailable", "full"))
            status, body = 202, b'{"id": "a"}'
            if len(keys) <= len(refusals):
                refusal = refusals[len(keys) - 1]
                status, body = refusal.status, json.dumps(refusal.as_dict()).encode()
            self.send_response(status)
            self.send_header(
                "Content-Type", "application/json" if status == 202 else "application/problem+json"
            )
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

    keys: list[str] = []
    pauses: list[float] = []
    meanwhile(pauses.append)
    server = ThreadingHTTPServer(("127.0.0.1", 0), Passing)
    with in_background(server), client.Client(f"http://127.0.0.1:{server.server_port}") as asking:
        assert asking.submit(PHOTO, None, {}) == {"id": "a"}
    assert pauses == [1, 1]
    assert len(keys) == 3
    assert len(set(keys)) == 1


def test_a_file_whose_connection_breaks_is_asked_for_again(meanwhile: Callable[..., None]) -> None:
    class Breaking(BaseHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            """Say nothing."""

        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Length", "10")
            self.end_headers()
            self.wfile.write(b"0123456789"[: 10 if pauses else 5])

    pauses: list[float] = []
    meanwhile(pauses.append)
    server = ThreadingHTTPServer(("127.0.0.1", 0), Breaking)
    with in_background(server), client.Client(f"http://127.0.0.1:{server.server_port}") as asking:
        assert asking.download("/file") == b"0123456789"
    assert pauses == [1]


def test_an_upload_whose_connection_breaks_is_sent_again(
    folder: Path, meanwhile: Callable[..., None]
) -> None:
    """Under the same key, so that it is one job."""

    class Breaking(BaseHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            """Say nothing."""

        def do_POST(self) -> None:
            self.rfile.read(int(self.headers["Content-Length"]))
            keys.append(self.headers["Idempotency-Key"])
            if len(keys) == 3:
                self.send_response(202)
                self.send_header("Content-Length", "11")
                self.end_headers()
                self.wfile.write(b'{"id": "a"}')

    keys: list[str] = []
    pauses: list[float] = []
    meanwhile(pauses.append)
    server = ThreadingHTTPServer(("127.0.0.1", 0), Breaking)
    with in_background(server), client.Client(f"http://127.0.0.1:{server.server_port}") as asking:
        assert asking.submit(PHOTO, None, {}) == {"id": "a"}
    assert pauses == [1, 1]
    assert len(keys) == 3
    assert len(set(keys)) == 1


def test_a_service_that_ends_in_mid_upload_is_waited_for(
    folder: Path, meanwhile: Callable[..., None], capsys: pytest.CaptureFixture[str]
) -> None:
    def end(seconds: float) -> None:
        pauses.append(seconds)
        listener.close()

    pauses: list[float] = []
    meanwhile(end)
    listener = socket.create_server(("127.0.0.1", 0))
    url = f"http://127.0.0.1:{listener.getsockname()[1]}"

    def hang_up() -> None:
        connection, _ = listener.accept()
        connection.recv(1)
        connection.close()

    threading.Thread(target=hang_up, daemon=True).start()
    line = said(capsys, url, "photo.png", code=1)
    assert line.startswith(f"gcvec: {url}: ")
    assert len(pauses) == 10
    assert said(capsys, url, "photo.png", code=1).startswith(f"gcvec: {url}: ")  # nobody is there: at once
    assert len(pauses) == 10
