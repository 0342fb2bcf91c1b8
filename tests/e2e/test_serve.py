"""`gcvec serve` and its children: they live, restart and die together."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import httpx
import pytest

from tests.broker import client_of
from tests.running_service import RunningService, start_service
from tests.waiting import within

pytestmark = pytest.mark.service


def descendants(pid: int) -> list[int]:
    """All processes below `pid`."""
    listing = subprocess.run(["ps", "-eo", "pid=,ppid="], capture_output=True, text=True, check=True).stdout
    children: dict[int, list[int]] = {}
    for line in listing.splitlines():
        child, parent = map(int, line.split())
        children.setdefault(parent, []).append(child)
    found, open_ends = [], [pid]
    while open_ends:
        below = children.get(open_ends.pop(), [])
        found += below
        open_ends += below
    return found


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2][0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="the kernel's parent-death signal is Linux's")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_process_is_left(tmp_path: Path, how: signal.Signals) -> None:
    service = start_service(tmp_path / "data", "--workers", "2")
    within(10, lambda: "ready." in service.log.read_text())
    processes = descendants(service.process.pid)
    assert len(processes) >= 5  # broker, API, worker and its two
    assert service.stop(how) == (0 if how != signal.SIGKILL else -signal.SIGKILL)
    within(10, lambda: not any(map(alive, processes)))


def test_a_child_that_dies_is_started_again(tmp_path: Path) -> None:
    service = start_service(tmp_path / "data", "--workers", "1")
    try:
        before = set(direct := descendants(service.process.pid))
        for pid in direct:
            os.kill(pid, signal.SIGKILL)

        def ready() -> bool:
            try:
                return httpx.get(f"{service.url}/readyz").status_code == 200
            except httpx.TransportError:
                return False

        within(20, lambda: len(set(descendants(service.process.pid)) - before) >= 4 and ready())
    finally:
        assert service.stop() == 0


def test_a_broker_that_is_named_is_used(tmp_path: Path, broker_url: str) -> None:
    service = start_service(tmp_path / "data", "--workers", "1", GCVEC_BROKER_URL=broker_url)
    try:
        files = {"image": ("a.txt", b"no picture")}
        assert httpx.post(f"{service.url}/v1/jobs", files=files).status_code == 415
        assert not (tmp_path / "data" / "broker").exists()
        client = client_of(broker_url)
        within(10, lambda: client.exists("_kombu.binding.gcvec-jobs"))
    finally:
        assert service.stop() == 0


@pytest.mark.parametrize("what", ["port", "folder"])
def test_what_is_taken_is_named(tmp_path: Path, running_service: RunningService, what: str) -> None:
    port = running_service.url.rpartition(":")[2] if what == "port" else "0"
    data = running_service.data if what == "folder" else tmp_path / "other"
    done = subprocess.run(
        [sys.executable, "-m", "gcvec.cli", "serve", "--port", port, "--data", str(data)],
        capture_output=True,
        text=True,
        timeout=30,
    )
    assert done.returncode == 2
    assert (port if what == "port" else str(data)) in done.stderr.splitlines()[-1]
    assert httpx.get(f"{running_service.url}/readyz").status_code == 200
