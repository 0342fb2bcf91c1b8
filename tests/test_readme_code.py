"""The code in README.md runs as it is printed. Only the service's address is that of a free port."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from http.server import ThreadingHTTPServer
from pathlib import Path
from shutil import copytree

import httpx
import numpy as np
import pytest
from PIL import Image
from skimage import data

from gcvec import VectorImage
from tests.browser import Browser
from tests.running_service import RunningService
from tests.servers import QuietFiles, in_background
from tests.waiting import within

README = (Path(__file__).parents[1] / "README.md").read_text()
STATIC = Path(__file__).parents[1] / "service" / "static"
ADDRESS = "http://127.0.0.1:8000"
SIDE = 96

REGIONS = f"""<annotations><version>1.1</version>
<image id="0" name="photo.jpg" width="{SIDE}" height="{SIDE}">
<polygon label="head" points="30,10;70,15;75,60;40,75;25,45" z_order="1"/>
<polygon label="rest" points="0,0;{SIDE},0;{SIDE},{SIDE};0,{SIDE}" z_order="0"/>
</image></annotations>"""


def block(language: str, holding: str) -> str:
    """The only code block in a language that holds some text."""
    blocks = re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)
    (found,) = [text for text in blocks if holding in text]
    return str(found)


def shell(script: str, folder: Path) -> str:
    """What a shell prints that has `gcvec` on its path and stops at the first failure."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    command = ["bash", "-euo", "pipefail", "-c", script]
    run = subprocess.run(
        command, cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("readme")
    Image.fromarray(data.astronaut()[:SIDE, 150 : 150 + SIDE]).save(folder / "photo.jpg", quality=90)
    (folder / "regions.xml").write_text(REGIONS)
    return folder


def size(picture: Path) -> tuple[int, int]:
    with Image.open(picture) as opened:
        return opened.size


@pytest.fixture(scope="module")
def commands(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the command line's block has run; what it printed is in shown.txt."""
    commands = copytree(folder, tmp_path_factory.mktemp("readme") / "commands")
    (commands / "shown.txt").write_text(shell(block("sh", "gcvec vectorize"), commands))
    return commands


def test_the_command_line(commands: Path) -> None:
    report = json.loads((commands / "report.json").read_text())
    assert re.search(rf"^mse +{report['mse']:.4f}$", (commands / "shown.txt").read_text(), re.MULTILINE)
    assert size(commands / "preview.png") == (SIDE, SIDE)
    assert size(commands / "poster.png") == (4 * SIDE, 4 * SIDE)
    assert json.loads((commands / "photo.json").read_text())["format"] == "gcvec/1"


def test_the_python_interface(folder: Path) -> None:
    code = block("python", "import") + "print(image.report.mse, pixels.shape, pixels.dtype)"
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code], cwd=folder, capture_output=True, text=True, timeout=300
    )
    assert run.returncode == 0, run.stderr
    mse, shown = run.stdout.split(" ", 1)
    assert shown.strip() == f"({4 * SIDE}, {4 * SIDE}, 3) uint8"
    image = VectorImage.load(folder / "photo.gcv")
    assert image.labels == ("rest", "head")
    error = image.render() - np.asarray(Image.open(folder / "photo.jpg")).astype(float)
    assert float(mse) == pytest.approx((error**2).mean())


@pytest.mark.service
def test_the_session_with_curl(folder: Path, running_service: RunningService) -> None:
    session = block("sh", "curl")
    assert session.count(ADDRESS) == 1
    shown = shell(session.replace(ADDRESS, running_service.url), folder)
    assert re.findall(r"^event: (\w+)$", shown, re.MULTILINE)[0] == "snapshot"
    assert "event: progress" in shown
    assert shown.count('"status":"succeeded"') >= 2  # the last event, and the job that was waited for
    assert '"revision":1' in shown
    image = VectorImage.load(folder / "result.gcv")
    description = json.loads((folder / "result.json").read_text())
    assert len(description["patches"]) == len(image.labels) == 2
    assert size(folder / "preview.png") == (2 * SIDE, 2 * SIDE)
    job = re.findall(r'"self":"(/v1/jobs/[0-9a-f]{32})"', shown)[0]
    assert httpx.get(running_service.url + job).status_code == 410


@pytest.fixture
def site(commands: Path, tmp_path: Path) -> Iterator[str]:
    """The page of the README, beside the drawing module and a result."""
    copytree(STATIC, tmp_path / "site")
    image = VectorImage.load(commands / "photo.gcv")
    (tmp_path / "site" / "result.json").write_text(json.dumps(image.description()))
    html = block("html", "GcvecView")
    head = '<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,"><style>body{margin:0}</style>'
    (tmp_path / "site" / "page.html").write_text(head + html)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(QuietFiles, directory=str(tmp_path / "site")))
    with in_background(server):
        yield f"http://127.0.0.1:{server.server_port}/page.html"


@pytest.mark.browser
def test_the_page_draws_the_result(browser: Browser, commands: Path, site: str) -> None:
    with browser.page(2 * SIDE, 2 * SIDE) as page:
        page.open(site)
        middle = VectorImage.load(commands / "photo.gcv").render(2)[SIDE, SIDE].astype(int)

        def drawn() -> np.ndarray:
            return np.asarray(page.screenshot())[SIDE, SIDE, :3].astype(int)

        within(30, lambda: np.abs(drawn() - middle).max() < 24)
        assert page.errors == []
