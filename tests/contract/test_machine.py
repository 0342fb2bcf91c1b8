"""Section 1: two commands on a fresh machine."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

from tests.readers import require

ROOT = Path(__file__).parents[2]
TARGETS = ("help", "install", "demo", "test", "check", "serve", "bench")


def make(*arguments: str) -> str:
    # What the make that runs these tests hands on would make this one tell where it is.
    outside = {name: value for name, value in os.environ.items() if not name.startswith("MAKE")}
    run = subprocess.run(
        [require("make", "make"), *arguments],
        cwd=ROOT,
        env=outside,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.mark.contract("1: make help")
def test_make_help_has_one_line_for_each_target() -> None:
    lines = make("help").splitlines()
    assert {*TARGETS} <= {line.split()[1] for line in lines}
    assert all(re.fullmatch(r"make \w+ +\S.*", line) for line in lines)


@pytest.mark.contract("1: make demo, make test")
@pytest.mark.parametrize(
    ("target", "command"),
    [
        ("demo", "-m examples.demo"),
        ("test", "pytest"),
        ("serve", "gcvec serve"),
        ("check", "-m service.openapi --check"),
        ("bench", "-m benchmarks"),
    ],
)
def test_make_targets_install_first_and_then_run(target: str, command: str) -> None:
    planned = make("--dry-run", "--always-make", target)
    installing, running = planned.index("-r requirements.lock"), planned.rindex(command)
    assert installing < running


@pytest.mark.contract("1: Python >= 3.11")
def test_the_lock_pins_every_package() -> None:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    packages = [line for line in lines if line and not line.startswith((" ", "#"))]
    assert packages
    assert [line for line in packages if "==" not in line] == []
