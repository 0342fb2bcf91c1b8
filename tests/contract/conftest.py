"""What is promised to users, row by row, through the real command and the real service."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image

from tests.conftest import RunningService, start_service

WIDTH, HEIGHT = 64, 48
ALICE, BOB = "alice-has-a-long-key", "bob-has-another-long-key"

SHORT_RETENTION = "PT3S"
SMALL_LIMITS = {
    "GCVEC_MAX_UPLOAD_BYTES": "100000",
    "GCVEC_MAX_SIDE": "300",
    "GCVEC_MAX_PIXELS": "50000",
    "GCVEC_MAX_POLYGONS": "3",
    "GCVEC_MAX_POLYGON_VERTICES": "10",
    "GCVEC_MAX_VERTICES": "12",
}


def gcvec(*arguments: object, cwd: Path | None = None, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run the command with its outputs in pipes."""
    command = [sys.executable, "-m", "gcvec.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=180, **more)


def done(run: subprocess.CompletedProcess[str]) -> subprocess.CompletedProcess[str]:
    """A run that went well and, in a pipe, said nothing on stderr."""
    assert (run.returncode, run.stderr) == (0, "")
    return run


def photo_pixels() -> np.ndarray:
    """A shaded box on a shaded ground, `(48, 64, 3) uint8`."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    ground = np.stack([60 + x, 90 + y, 200 - x - y], axis=-1)
    box = np.stack([250 - x, 120 + x, 40 + 2 * y], axis=-1)
    inside = (x >= 17) & (x < 43) & (y >= 14) & (y < 34)
    return np.asarray(np.where(inside[..., None], box, ground), np.uint8)


def encoded(image: Image.Image, kind: str = "PNG", **options: Any) -> bytes:
    buffer = io.BytesIO()
    image.save(buffer, kind, **options)
    return buffer.getvalue()


def polygon(points: str, label: str = "it", z_order: int = 0) -> str:
    return f'<polygon label="{label}" points="{points}" z_order="{z_order}"></polygon>'


GROUND = polygon(f"0,0;{WIDTH},0;{WIDTH},{HEIGHT};0,{HEIGHT}", "ground")
BOX = polygon("16,12;45,15;41,36;18,33", "box", 1)


def cvat(*polygons: str, name: str = "photo.png", width: int = WIDTH, height: int = HEIGHT) -> str:
    shapes = "\n".join(polygons)
    image = f'<image id="0" name="{name}" width="{width}" height="{height}">\n{shapes}\n</image>'
    return f'<?xml version="1.0"?>\n<annotations><version>1.1</version>\n{image}\n</annotations>'


def pixels(data: bytes | Path) -> np.ndarray:
    with Image.open(io.BytesIO(data) if isinstance(data, bytes) else data) as picture:
        return np.asarray(picture.convert("RGB")).astype(float)


@pytest.fixture(scope="session")
def photo() -> bytes:
    return encoded(Image.fromarray(photo_pixels()))


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory, photo: bytes) -> Path:
    """A photo, its regions, and all that `gcvec vectorize` writes for them."""
    folder = tmp_path_factory.mktemp("contract")
    (folder / "photo.png").write_bytes(photo)
    (folder / "photo.xml").write_text(cvat(GROUND, BOX))
    files = ("photo.png", "-a", "photo.xml", "-o", "photo.gcv", "--report", "r.json", "--preview", "p.png")
    done(gcvec("vectorize", *files, cwd=folder))
    return folder


@pytest.fixture(scope="session")
def report(folder: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads((folder / "r.json").read_text())
    return content


@pytest.fixture(scope="session")
def api(running_service: RunningService) -> Iterator[httpx.Client]:
    """A client of a service as it is without any setting."""
    with httpx.Client(base_url=running_service.url, timeout=60) as client:
        yield client


@pytest.fixture(scope="session")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[httpx.Client]:
    """A client of a service with keys, low limits and a short memory; sends Alice's key."""
    data = tmp_path_factory.mktemp("guarded") / "data"
    settings = {"GCVEC_API_KEYS": f"{ALICE},{BOB}", "GCVEC_RETENTION": SHORT_RETENTION, **SMALL_LIMITS}
    service = start_service(data, "--workers", "1", **settings)
    with httpx.Client(base_url=service.url, timeout=60, headers=key(ALICE)) as client:
        yield client
    assert service.stop() == 0


def key(value: str) -> dict[str, str]:
    return {"Authorization": f"Bearer {value}"}


def post(
    api: httpx.Client,
    image: bytes,
    annotations: str | None = None,
    *,
    name: str = "photo.png",
    headers: dict[str, str] | None = None,
    **options: Any,
) -> httpx.Response:
    files = {"image": (name, image)}
    if annotations is not None:
        files["annotations"] = ("regions.xml", annotations.encode())
    return api.post("/v1/jobs", files=files, data={"options": json.dumps(options)}, headers=headers)


def submitted(api: httpx.Client, image: bytes, annotations: str | None = None, **more: Any) -> dict[str, Any]:
    answer = post(api, image, annotations, **more)
    assert answer.status_code == 202, answer.text
    job: dict[str, Any] = answer.json()
    return job


def ended(api: httpx.Client, job: dict[str, Any]) -> dict[str, Any]:
    """The job once it has ended."""
    for _ in range(8):
        now: dict[str, Any] = api.get(f"{job['links']['self']}?wait=30").json()
        if now["status"] not in ("queued", "running"):
            return now
    raise AssertionError(f"not ended: {now}")


def problem(answer: httpx.Response, status: int, code: str) -> dict[str, Any]:
    """The problem document of a refusal, after RFC 9457."""
    assert answer.headers["content-type"] == "application/problem+json"
    content: dict[str, Any] = answer.json()
    assert (answer.status_code, content["status"]) == (status, status), content
    assert content["type"] == f"urn:gcvec:problem:{code}"
    assert {"type", "title", "status", "detail"} <= set(content) <= {"pointer", *content}
    return content


@pytest.fixture(scope="session")
def finished(api: httpx.Client, photo: bytes) -> dict[str, Any]:
    """A job that has succeeded."""
    job = ended(api, submitted(api, photo, cvat(GROUND, BOX)))
    assert job["status"] == "succeeded", job
    return job
