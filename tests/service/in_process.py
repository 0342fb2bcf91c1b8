"""The API in this process, what it has stored, and jobs that a test moves along as a worker would."""

from __future__ import annotations

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx

from service.app import create_app
from service.server import Server
from tests.broker import client_of
from tests.uploads import png
from worker import storage
from worker.artifacts import KINDS
from worker.records import JobRecords
from worker.settings import Settings
from worker.steps import claim, finish
from worker.storage import Manifest


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


def files_in(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


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
