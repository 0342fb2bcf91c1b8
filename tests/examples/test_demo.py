"""`make demo`, from the outside."""

import json
import os
import subprocess
import sys
import uuid
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PICTURES = {"preview.png", "error.png", "patches.png", "result.pdf", "result.svg"}
FILES = {"result.json", "result.gcv", "report.json"} | PICTURES


@pytest.mark.slow
@pytest.mark.service
def test_demo_writes_everything_and_leaves_nothing(tmp_path: Path) -> None:
    mark = uuid.uuid4().hex
    run = subprocess.run(
        [sys.executable, "-m", "examples.demo", tmp_path / "out"],
        cwd=ROOT,
        env={**os.environ, "GCVEC_TEST_MARK": mark, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert run.returncode == 0, run.stderr
    assert {path.name for path in (tmp_path / "out").iterdir()} >= FILES
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert f"patches{report['patches']:>39}" in run.stdout
    assert report["mse"] <= 6
    assert report["foldovers"] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    assert processes_with(mark) == []


def processes_with(mark: str) -> list[str]:
    """Command lines of the running processes that have inherited `mark` in their environment (Linux)."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if mark.encode() in (folder / "environ").read_bytes():
                found.append((folder / "cmdline").read_text().replace("\0", " "))
        except OSError:  # ended meanwhile, or not ours
            continue
    return found
