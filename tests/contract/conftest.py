"""What is promised to users, row by row, through the real command and the real service."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from PIL import Image

from tests.command import done, gcvec
from tests.contract.client import ended, submitted
from tests.keys import ALICE, BOB, key
from tests.picture_files import encoded
from tests.running_service import RunningService, start_service
from tests.shaded_box import BOX, GROUND, cvat, photo_pixels

SHORT_RETENTION = "PT3S"
SMALL_LIMITS = {
    "GCVEC_MAX_UPLOAD_BYTES": "100000",
    "GCVEC_MAX_SIDE": "300",
    "GCVEC_MAX_PIXELS": "50000",
    "GCVEC_MAX_POLYGONS": "3",
    "GCVEC_MAX_POLYGON_VERTICES": "10",
    "GCVEC_MAX_VERTICES": "12",
}


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


@pytest.fixture(scope="session")
def finished(api: httpx.Client, photo: bytes) -> dict[str, Any]:
    """A job that has succeeded."""
    job = ended(api, submitted(api, photo, cvat(GROUND, BOX)))
    assert job["status"] == "succeeded", job
    return job
