"""Real servers for the tests that need them: a broker, and the whole service."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path

import pytest
import redis

from service.broker import private_broker, wait_until_ready
from tests.browser import Browser
from worker.process import die_with
from worker.records import connect


@dataclass
class RunningService:
    """A `gcvec serve` that answers at `url`."""

    process: subprocess.Popen[str]
    url: str
    data: Path
    log: Path

    def stop(self, how: signal.Signals = signal.SIGTERM) -> int:
        """Ask it to end; its exit code."""
        self.process.send_signal(how)
        try:
            self.process.communicate(timeout=30)
        finally:
            self.process.kill()
        return self.process.returncode


def start_service(data: Path, *options: str, **environment: str) -> RunningService:
    """Start `gcvec serve` on a free port and wait until it says that it is ready."""
    log = data.parent / f"{data.name}.log"
    with log.open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "gcvec.cli", "serve", "--port", "0", "--data", str(data), *options],
            env={**os.environ, **environment},
            stdout=subprocess.PIPE,
            stderr=errors,
            text=True,
        )
    assert process.stdout is not None
    line = process.stdout.readline()
    if not line.startswith("gcvec serves "):
        process.kill()
        pytest.fail(f"the service did not start: {line}{log.read_text()}")
    return RunningService(process, line.split()[-1], data, log)


@pytest.fixture(scope="session")
def running_service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    """One service for all tests that do not harm it."""
    service = start_service(tmp_path_factory.mktemp("service") / "data", "--workers", "2")
    yield service
    assert service.stop() == 0


@pytest.fixture(scope="session")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """One headless Chromium for all tests; without one they are skipped, or fail on CI."""
    browser = Browser(tmp_path_factory.mktemp("browser"))
    yield browser
    browser.close()


@pytest.fixture(scope="session")
def broker_url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """A Redis-protocol server of our own."""
    broker = private_broker(tmp_path_factory.mktemp("broker"))
    dying = partial(die_with, os.getpid())
    process = subprocess.Popen(broker.command.arguments, stdin=subprocess.PIPE, preexec_fn=dying)
    assert process.stdin is not None
    process.stdin.write(broker.command.stdin or b"")
    process.stdin.close()
    assert wait_until_ready(broker.url, 10)
    yield broker.url
    client_of(broker.url).close()
    process.terminate()
    process.wait(10)


@cache
def client_of(broker_url: str) -> redis.Redis:
    """The one connection of all tests to their broker; `broker_url` closes it."""
    return connect(broker_url, patient=False)


@pytest.fixture
def eventually() -> Callable[..., None]:
    """Wait until a condition holds; fail if it does not within some seconds."""

    def wait(condition: Callable[[], object], seconds: float = 10) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, f"not within {seconds} s"
            time.sleep(0.05)

    return wait
