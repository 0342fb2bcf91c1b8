"""The API in this process, on a real broker, without workers: jobs stay queued until a test moves them."""

from __future__ import annotations

import io
import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from PIL import Image

from service.app import create_app
from service.server import Server
from tests.conftest import client_of
from worker import storage
from worker.artifacts import KINDS
from worker.records import JobRecords, claim, finish
from worker.settings import Settings
from worker.storage import Manifest


@pytest.fixture
def settings(broker_url: str, tmp_path: Path) -> Settings:
    client_of(broker_url).flushall()
    return Settings(broker_url=broker_url, data_dir=tmp_path, max_upload_bytes=100_000, max_side=200)


@pytest.fixture
def api(settings: Settings) -> Iterator[httpx.Client]:
    with serving(settings) as client:
        yield client


@contextmanager
def serving(settings: Settings, host: str = "127.0.0.1") -> Iterator[httpx.Client]:
    """The application on a free port, served from a thread of this process."""
    listener = socket.create_server((host, 0))
    server = Server(create_app(settings))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{listener.getsockname()[1]}", timeout=30) as client:
            yield client
    finally:
        server.should_exit = True
        thread.join()
        listener.close()


def png(width: int = 30, height: int = 20) -> bytes:
    buffer = io.BytesIO()
    Image.new("RGB", (width, height), (200, 30, 30)).save(buffer, "PNG")
    return buffer.getvalue()


def cvat(
    name: str = "a.png", width: int = 30, height: int = 20, points: str = "1,1;20,1;20,15;1,15"
) -> bytes:
    polygon = f'<polygon label="x" source="manual" occluded="0" points="{points}" z_order="0"></polygon>'
    image = f'<image id="0" name="{name}" width="{width}" height="{height}">{polygon}</image>'
    return f'<?xml version="1.0"?><annotations><version>1.1</version>{image}</annotations>'.encode()


class Jobs:
    """Submits jobs over HTTP and plays the worker's part directly on records and store."""

    def __init__(self, api: httpx.Client, settings: Settings) -> None:
        self._api = api
        self._settings = settings
        self.store = storage.open_store(settings.storage)
        self.records = JobRecords(client_of(settings.broker_url))

    def submit(self, **options: Any) -> str:
        files = {"image": ("a.png", png())}
        answer = self._api.post("/v1/jobs", files=files, data={"options": json.dumps(options)})
        assert answer.status_code == 202, answer.text
        job_id: str = answer.json()["id"]
        return job_id

    def finished(self, content: bytes = b"0123456789") -> str:
        """A job that has succeeded; every artefact holds `content`."""
        job_id = self.submit()
        assert self.records.run(claim(job_id)) == 1
        folder = storage.attempt_folder(job_id, 1)
        files = {
            name: storage.write(self.store, f"{folder}/{kind.filename}", content)
            for name, kind in KINDS.items()
        }
        assert storage.commit(self.store, job_id, Manifest(1, files, ("a warning",)))
        assert self.records.run(finish(job_id, "succeeded", retention=60, warnings=("a warning",)))
        return job_id


@pytest.fixture
def jobs(api: httpx.Client, settings: Settings) -> Jobs:
    return Jobs(api, settings)
