"""The command as users and scripts run it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

GCVEC = (sys.executable, "-m", "gcvec.cli")


def gcvec(*arguments: object, cwd: Path | None = None, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run the command with its outputs in pipes."""
    command = [*GCVEC, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=180, **more)


def done(run: subprocess.CompletedProcess[str]) -> subprocess.CompletedProcess[str]:
    """A run that went well and, in a pipe, said nothing on stderr."""
    assert (run.returncode, run.stderr) == (0, "")
    return run


def refused(run: subprocess.CompletedProcess[str], *named: object) -> None:
    """Bad input: exit 2, and one line on stderr that holds all of `named`."""
    assert run.returncode == 2, run.stderr
    assert run.stdout == ""
    assert run.stderr.startswith("gcvec: ")
    assert run.stderr.count("\n") == 1
    for part in named:
        assert str(part) in run.stderr
