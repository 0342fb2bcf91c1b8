"""The whole way: upload over HTTP, the queue, a worker, the engine, events, files."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import httpx
import jsonschema
import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage
from tests.event_stream import events_of
from tests.running_service import RunningService
from tests.waiting import within
from worker.artifacts import EXPORTS, KINDS

pytestmark = pytest.mark.service

ROOT = Path(__file__).parents[2]


@pytest.fixture
def api(running_service: RunningService) -> Iterator[httpx.Client]:
    with httpx.Client(base_url=running_service.url, timeout=60) as client:
        yield client


@pytest.fixture(scope="module")
def photo() -> bytes:
    """A small piece of a real photo, with sky, cloth and skin: 128 x 128 pixels."""
    from skimage import data

    return encoded(data.astronaut()[:128, 128:256])


def encoded(pixels: Any) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


CVAT = """<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version><image id="0" name="photo.png" width="128" height="128">
<polygon label="head" points="50,20;100,25;110,90;60,110;40,70" z_order="1"></polygon>
<polygon label="left" points="0,0;40,0;45,128;0,128" z_order="0"></polygon>
<polygon label="bow" points="10,10;60,60;10,60;60,10" z_order="2"></polygon>
<polygon label="outside" points="300,300;310,300;310,310" z_order="2"></polygon>
</image></annotations>"""


def submit(api: httpx.Client, photo: bytes, **options: Any) -> dict[str, Any]:
    files = {"image": ("photo.png", photo), "annotations": ("photo.xml", CVAT.encode())}
    answer = api.post("/v1/jobs", files=files, data={"options": json.dumps(options)})
    assert answer.status_code == 202, answer.text
    job: dict[str, Any] = answer.json()
    return job


def events(api: httpx.Client, job: dict[str, Any]) -> Iterator[dict[str, Any]]:
    with api.stream("GET", job["links"]["events"]) as answer:
        yield from events_of(answer)


def test_a_photo_becomes_patches(api: httpx.Client, photo: bytes) -> None:
    job = submit(api, photo, target_mse=20)
    first, *middle, last = events(api, job)
    assert first["event"] == "snapshot"
    assert {event["event"] for event in middle} == {"progress"}
    assert (last["event"], last["data"]["status"]) == ("state", "succeeded"), last

    numbers = [int(event["id"]) for event in (*middle, last)]
    assert all(later > earlier for earlier, later in pairwise(numbers))
    iterations = [event["data"]["iteration"] for event in middle if event["data"]["phase"] == "refine"]
    assert iterations
    assert iterations == list(range(1, len(iterations) + 1))
    fractions = [event["data"]["fraction"] for event in middle]
    assert fractions == sorted(fractions)

    job = api.get(job["links"]["self"]).json()
    assert job == last["data"]
    files = {name: api.get(job["links"][name]) for name in KINDS}
    assert {answer.status_code for answer in files.values()} == {200}

    result, report = files["result"].json(), files["report"].json()
    jsonschema.validate(result, json.loads((ROOT / "openapi" / "result.schema.json").read_text()))
    assert result["format"] == "gcvec/1"
    assert result["patches"]
    assert report["image"] == {"width": 128, "height": 128}
    assert report["foldovers"] == 0
    assert report["bytes"] == len(files["gcv"].content)
    assert any("outside" in warning for warning in job["warnings"])

    truth = np.asarray(Image.open(io.BytesIO(photo)).convert("RGB")).astype(float)
    preview = np.asarray(Image.open(io.BytesIO(files["preview"].content)).convert("RGB")).astype(float)
    assert preview.shape == truth.shape
    mse = float(((preview - truth) ** 2).mean())
    assert mse == pytest.approx(report["mse"], abs=0.05)
    for name in ("error", "patches"):
        assert Image.open(io.BytesIO(files[name].content)).size == (128, 128)


@pytest.fixture(scope="module")
def finished(running_service: RunningService, photo: bytes) -> dict[str, Any]:
    """A job that has succeeded."""
    with httpx.Client(base_url=running_service.url, timeout=60) as api:
        job = submit(api, photo, target_mse=60)
        link = f"{job['links']['self']}?wait=30"
        while (job := api.get(link).json())["status"] in ("queued", "running"):
            pass
    assert job["status"] == "succeeded", job
    return job


@pytest.mark.parametrize(("name", "start"), [("svg", b"<"), ("pdf", b"%PDF-"), ("glb", b"glTF")])
def test_exports_are_made_when_they_are_asked_for(
    api: httpx.Client, finished: dict[str, Any], name: str, start: bytes
) -> None:
    answer = api.get(finished["links"][name])
    assert answer.status_code == 200, answer.text
    assert answer.content.startswith(start)
    assert answer.headers["content-type"] == EXPORTS[name].media_type
    again = api.get(finished["links"][name], headers={"If-None-Match": answer.headers["etag"]})
    assert again.status_code == 304


@pytest.mark.parametrize("scale", [0.5, 2.25])
def test_a_preview_is_drawn_at_any_scale(api: httpx.Client, finished: dict[str, Any], scale: float) -> None:
    gcv = VectorImage.from_bytes(api.get(finished["links"]["gcv"]).content)
    answer = api.get(finished["links"]["preview"], params={"scale": scale})
    assert answer.status_code == 200, answer.text
    drawn = np.asarray(Image.open(io.BytesIO(answer.content)))
    assert np.array_equal(drawn, gcv.render(scale))


def test_a_running_job_is_cancelled_at_once(
    api: httpx.Client, photo: bytes, running_service: RunningService
) -> None:
    job = submit(api, photo, target_mse=0.01, max_points=0, strategy="paper")
    stream = events(api, job)
    assert next(event for event in stream if event["event"] == "progress")
    assert api.delete(job["links"]["self"]).status_code == 204
    assert next(event for event in stream if event["event"] == "state")["data"]["status"] == "canceled"
    assert api.get(job["links"]["self"]).json()["status"] == "canceled"
    assert api.get(f"{job['links']['self']}/result").status_code == 409
    stopped = f"job {job['id']}: attempt 1 stopped"
    within(30, lambda: stopped in running_service.log.read_text())  # left alone it runs for an hour
    within(10, lambda: not (running_service.data / "storage/jobs" / job["id"]).exists())


def test_the_command_line_client_fetches_everything(
    running_service: RunningService, photo: bytes, tmp_path: Path
) -> None:
    (tmp_path / "photo.png").write_bytes(photo)
    (tmp_path / "photo.xml").write_text(CVAT)
    options = ("--target-mse", "50", "--regions", "7")
    done = gcvec_submit(running_service, tmp_path, "photo.png", "-a", "photo.xml", *options)
    assert (done.returncode, done.stdout) == (0, ""), done.stderr
    assert "outside" in done.stderr
    assert done.stderr.count("regions has no effect") == 1  # the service says so too
    assert {file.name for file in (tmp_path / "out").iterdir()} == {
        kind.filename for kind in (KINDS | EXPORTS).values()
    }


def test_the_command_line_client_names_what_is_wrong(
    running_service: RunningService, photo: bytes, tmp_path: Path
) -> None:
    (tmp_path / "photo.png").write_bytes(photo)
    (tmp_path / "broken.xml").write_text("<annotations>")
    done = gcvec_submit(running_service, tmp_path, "photo.png", "-a", "broken.xml")
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert done.stderr.startswith("gcvec: broken.xml: broken annotations")
    assert done.stderr.count("line 1") == 1


def gcvec_submit(service: RunningService, folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gcvec.cli", "submit", *arguments, "--url", service.url, "-o", "out"]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=120)
