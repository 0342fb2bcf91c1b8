"""How the service bears many clients: ``python -m benchmarks.load``.

A service of its own runs on loopback, with a worker that is busy all the while. Printed are the time that a
look at a job takes while many look, what it costs the API, the time that a job takes beyond the engine's own,
and how a flood of submissions is answered.
"""

from __future__ import annotations

import argparse
import asyncio
import io
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
from PIL import Image

QUICK = {"target_mse": 60}
SLOW = {"strategy": "paper", "target_mse": 0.01, "max_points": 0}
"""Options of a job that refines as long as it may."""


@dataclass
class Answer:
    """A response, whole."""

    status: int
    headers: dict[str, str]
    body: bytes

    def json(self) -> dict[str, Any]:
        content: dict[str, Any] = json.loads(self.body)
        return content


class Connection:
    """One kept-alive HTTP connection; no more than measuring needs, so that the client costs little."""

    def __init__(self, url: str) -> None:
        parts = urlsplit(url)
        self._host, self._port = parts.hostname or "", parts.port or 80
        self._reader: asyncio.StreamReader | None = None
        self._writer: asyncio.StreamWriter | None = None

    async def __aenter__(self) -> Connection:
        return self

    async def __aexit__(self, *_: object) -> None:
        if self._writer is not None:
            self._writer.close()
            with suppress(OSError):
                await self._writer.wait_closed()

    async def send(
        self, method: str, path: str, body: bytes = b"", content_type: str = ""
    ) -> tuple[int, dict[str, str], asyncio.StreamReader]:
        """Send a request; status and headers of the answer, whose body is yet to be read."""
        if self._reader is None or self._writer is None:
            self._reader, self._writer = await asyncio.open_connection(self._host, self._port)
        sort = f"Content-Type: {content_type}\r\n" if content_type else ""
        head = f"{method} {path} HTTP/1.1\r\nHost: {self._host}\r\nContent-Length: {len(body)}\r\n{sort}\r\n"
        self._writer.write(head.encode() + body)
        first, *lines = (await self._reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        headers = {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)}
        return int(first.split()[1]), headers, self._reader

    async def ask(self, method: str, path: str, body: bytes = b"", content_type: str = "") -> Answer:
        """Send a request and read its answer."""
        status, headers, reader = await self.send(method, path, body, content_type)
        content = await reader.readexactly(int(headers.get("content-length", 0)))
        return Answer(status, headers, content)


@dataclass
class Load:
    """What many clients met with."""

    seconds: list[float] = field(default_factory=list)
    statuses: Counter[int] = field(default_factory=Counter)
    events: int = 0
    ended: int = 0


def picture(side: int, seed: int) -> bytes:
    """A PNG of smooth noise."""
    rng = np.random.default_rng(seed)
    coarse = Image.fromarray(rng.integers(0, 255, (side // 6, side // 6, 3), dtype=np.uint8))
    buffer = io.BytesIO()
    coarse.resize((side, side), Image.Resampling.BICUBIC).save(buffer, "PNG")
    return buffer.getvalue()


def form(image: bytes, options: dict[str, Any]) -> tuple[bytes, str]:
    """The body and type of a submission."""
    parts = (
        b'--b\r\nContent-Disposition: form-data; name="image"; filename="a.png"\r\n\r\n' + image,
        b'--b\r\nContent-Disposition: form-data; name="options"\r\n\r\n' + json.dumps(options).encode(),
        b"--b--\r\n",
    )
    return b"\r\n".join(parts), "multipart/form-data; boundary=b"


async def submit(connection: Connection, side: int, seed: int, options: dict[str, Any]) -> Answer:
    return await connection.ask("POST", "/v1/jobs", *form(picture(side, seed), options))


async def poll(url: str, job_id: str, every: float, until: float, load: Load, start: float) -> None:
    """Look at a job every so many seconds, beginning at `start`."""
    async with Connection(url) as connection:
        await asyncio.sleep(max(0.0, start - time.monotonic()))
        while time.monotonic() < until:
            begun = time.perf_counter()
            answer = await connection.ask("GET", f"/v1/jobs/{job_id}")
            load.seconds.append(time.perf_counter() - begun)
            load.statuses[answer.status] += 1
            await asyncio.sleep(every)


async def listen(url: str, job_id: str, load: Load) -> None:
    """Follow the events of a job to their end."""
    async with Connection(url) as connection:
        status, _, reader = await connection.send("GET", f"/v1/jobs/{job_id}/events")
        load.statuses[status] += 1
        while line := await reader.readline():
            load.events += line.startswith(b"event:")
            load.ended += line.startswith(b"event: state")
            if line == b"0\r\n":
                return


async def poll_all(
    url: str, jobs: list[str], load: Load, *, clients: int, every: float, seconds: float
) -> None:
    """Let so many clients look at the jobs for so long, each every so many seconds."""
    chance = random.Random(1)
    begin = time.monotonic() + 1.0
    async with asyncio.TaskGroup() as group:
        for number in range(clients):
            start = begin + chance.uniform(0, every)
            job = jobs[number % len(jobs)]
            group.create_task(poll(url, job, every, begin + seconds, load, start))


async def listen_all(url: str, jobs: list[str], load: Load, *, clients: int) -> None:
    """Let so many clients follow the events of the jobs until these end."""
    await asyncio.gather(*(listen(url, jobs[number % len(jobs)], load) for number in range(clients)))


async def flood(url: str, count: int) -> list[Answer]:
    """So many submissions at a time."""

    async def one(seed: int) -> Answer:
        async with Connection(url) as connection:
            return await submit(connection, 24, seed, QUICK)

    return await asyncio.gather(*(one(seed) for seed in range(count)))


async def overheads(url: str, count: int) -> list[float]:
    """Seconds from the submission of a job to the news of its end, less those that the engine reports."""
    spent = []
    async with Connection(url) as connection:
        for seed in range(count):
            begun = time.perf_counter()
            link = (await submit(connection, 48, seed, QUICK)).headers["location"]
            job = (await connection.ask("GET", f"{link}?wait=30")).json()
            whole = time.perf_counter() - begun
            assert job["status"] == "succeeded", job
            report = (await connection.ask("GET", job["links"]["report"])).json()
            spent.append(whole - report["seconds"]["total"])
    return spent


def processor_seconds(pid: int) -> float:
    """What a process has used of processors so far."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def api_of(pid: int) -> int:
    """The API process that a `gcvec serve` has started."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    (api,) = [pid for pid in children if b"service.server" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    return int(api)


@contextmanager
def service(folder: Path, workers: int, **settings: str) -> Iterator[tuple[str, int]]:
    """A `gcvec serve` of its own; its address, and its API's process where such can be looked at, else 0."""
    command = (sys.executable, "-m", "gcvec.cli", "serve", "--port", "0", "--workers", str(workers))
    process = subprocess.Popen(
        (*command, "--data", str(folder)),
        env={**os.environ, **settings},
        stdout=subprocess.PIPE,
        stderr=(folder.parent / "log").open("w"),
        text=True,
    )
    try:
        assert process.stdout is not None
        line = process.stdout.readline()
        assert line.startswith("gcvec serves "), "the service does not start"
        yield line.split()[-1], api_of(process.pid) if sys.platform == "linux" else 0
    finally:
        process.terminate()
        process.wait(30)


async def measure(url: str, api: int, arguments: argparse.Namespace) -> None:
    """Print what is measured of the service at `url`; 0 for a process that cannot be looked at."""
    spent = await overheads(url, arguments.jobs)
    _print("a job beyond its engine time", spent[2:])  # the first jobs meet cold caches
    load = Load()
    async with Connection(url) as connection:
        answers = [await submit(connection, 96, seed, SLOW) for seed in range(20)]
        jobs = [answer.json()["id"] for answer in answers]
        listening = asyncio.create_task(listen_all(url, jobs, load, clients=arguments.listeners))
        used = processor_seconds(api) if api else 0.0
        await poll_all(
            url, jobs, load, clients=arguments.pollers, every=arguments.every, seconds=arguments.seconds
        )
        used = processor_seconds(api) - used if api else 0.0
        for job in jobs:
            await connection.ask("DELETE", f"/v1/jobs/{job}")
        await listening
    _print(f"a look of {arguments.pollers} clients, each every {arguments.every:g} s", load.seconds)
    rate = len(load.seconds) / arguments.seconds
    print(f"  {rate:.0f} looks a second; answers {dict(load.statuses)}; {load.events} events heard,")
    print(f"  {load.ended} of {arguments.listeners} streams heard to their end;")
    if api:
        share = used / arguments.seconds
        print(f"  the API used {share:.0%} of a core, {1000 * used / len(load.seconds):.2f} ms a look")
    begun = time.perf_counter()
    flooded = Counter(answer.status for answer in await flood(url, arguments.flood))
    took = time.perf_counter() - begun
    print(f"{arguments.flood} submissions at a time: {dict(flooded)} within {took:.1f} s")


def _print(what: str, seconds: list[float]) -> None:
    median, late, worst = 1000 * np.quantile(seconds, (0.5, 0.99, 1))
    print(f"{what}: median {median:.0f} ms, p99 {late:.0f} ms, longest {worst:.0f} ms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--pollers", type=int, default=1000)
    parser.add_argument("--listeners", type=int, default=100)
    parser.add_argument("--every", type=float, default=5.0, help="seconds between two looks of one client")
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--jobs", type=int, default=20, help="jobs whose overhead is measured")
    parser.add_argument("--flood", type=int, default=500)
    parser.add_argument("--url", help="a service that runs already, and asks for no key")
    arguments = parser.parse_args()
    if arguments.url:
        asyncio.run(measure(arguments.url, 0, arguments))
        return
    with (
        tempfile.TemporaryDirectory() as folder,
        service(Path(folder) / "data", 1, GCVEC_REQUESTS_PER_MINUTE="0") as (url, api),
    ):
        asyncio.run(measure(url, api, arguments))


if __name__ == "__main__":
    main()
