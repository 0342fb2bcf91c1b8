from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.fleet import Fleet


@pytest.fixture
def start_fleet(tmp_path: Path) -> Iterator[Callable[..., Fleet]]:
    """Start a broker; the test starts APIs and workers. Everything is killed at the end."""
    fleets: list[Fleet] = []

    def start(server: Path | None = None, **settings: str) -> Fleet:
        fleets.append(Fleet(tmp_path, server=server, **settings))
        return fleets[-1]

    yield start
    for fleet in fleets:
        fleet.close()


@pytest.fixture
def fleet(start_fleet: Callable[..., Fleet]) -> Fleet:
    return start_fleet()
