"""What `gcvec submit` says when something is wrong: one line that names the file, or the service."""

from __future__ import annotations

from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import httpx
import pytest

from gcvec.cli._app import run
from tests.servers import in_background
from tests.service.conftest import cvat, png

POLYGON = cvat(points="1,1;x,1;20,15")


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "photo.png").write_bytes(png())
    (tmp_path / "notes.png").write_text("no picture")
    (tmp_path / "other.xml").write_bytes(cvat(width=31))
    (tmp_path / "broken.xml").write_bytes(POLYGON)
    return tmp_path


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
        (["photo.png", "--target-mse", "-1"], "URL: ", " (/options/target_mse)"),
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
