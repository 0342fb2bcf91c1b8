"""The API in this process, on a real broker, without workers: jobs stay queued until a test moves them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from tests.broker import client_of
from tests.service.in_process import Jobs, serving
from worker.settings import Settings


@pytest.fixture
def settings(broker_url: str, tmp_path: Path) -> Settings:
    client_of(broker_url).flushall()
    return Settings(broker_url=broker_url, data_dir=tmp_path, max_upload_bytes=100_000, max_side=200)


@pytest.fixture
def api(settings: Settings) -> Iterator[httpx.Client]:
    with serving(settings) as client:
        yield client


@pytest.fixture
def jobs(api: httpx.Client, settings: Settings) -> Jobs:
    return Jobs(api, settings)
