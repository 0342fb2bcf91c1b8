"""Real servers for the tests that need them: a broker, and the whole service."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from service.broker import private_broker, wait_until_ready
from tests.broker import client_of
from tests.browser import Browser
from tests.running_service import RunningService, start_service
from tests.servers import in_background
from tests.webhook_receiver import Receiver
from worker.process import die_with


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first, so that none of them runs alone at the end.

    First those whose tests start services and mostly wait for them: three of these beside each other keep two
    processors busy. At the end come many short ones, which fill whatever gaps there are.
    """
    marks: dict[Path, set[str]] = {}
    for item in items:
        marks.setdefault(item.path, set()).update(mark.name for mark in item.iter_markers())

    def turn(item: pytest.Item) -> tuple[bool, bool]:
        return "service" not in marks[item.path], "slow" not in marks[item.path]

    items.sort(key=turn)


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


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    server = Receiver()
    with in_background(server):
        yield server
