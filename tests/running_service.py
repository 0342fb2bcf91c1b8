"""`gcvec serve` as a process of its own."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest


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
