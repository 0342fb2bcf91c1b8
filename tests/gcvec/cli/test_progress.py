"""The progress bar on a terminal, and Ctrl-C."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcvec.cli._app import run
from tests.command import GCVEC


def test_progress_bar_on_a_terminal(folder: Path, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    command = [*GCVEC, "vectorize", "photo.png", "-o", tmp_path / "a.gcv"]
    process = subprocess.Popen(
        [*command, "-a", "photo.xml"], stderr=theirs, cwd=folder, env={**os.environ, "TERM": "xterm"}
    )
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 65536):
            shown += chunk
    except OSError:  # how Linux says that the other end is closed
        pass
    os.close(ours)
    assert process.wait() == 0
    assert b"%" in shown
    assert b"MSE" in shown


def test_interrupt_is_quiet(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (600, 800, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    command = [
        sys.executable,
        "-m",
        "gcvec.cli",
        "vectorize",
        "noise.png",
        "-o",
        "a.gcv",
        "--max-points",
        "0",
    ]
    # A shell that runs tests in the background makes its children ignore the signal.
    listen = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path, preexec_fn=listen)
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, "")
    assert [p.name for p in tmp_path.iterdir()] == ["noise.png"]


def test_an_interrupt_before_the_work_is_quiet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gcvec.io.read_picture", interrupted)
    (tmp_path / "a.png").touch()
    assert run(["vectorize", str(tmp_path / "a.png"), "-o", str(tmp_path / "a.gcv")]) == 130
    assert capsys.readouterr() == ("", "")


def test_an_interrupt_inside_a_kernel_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiled kernel returns first; then the interpreter wraps the interrupt."""

    def interrupted(*_: object, **__: object) -> None:
        try:
            raise SystemError("returned a result with an exception set") from KeyboardInterrupt()
        except SystemError as error:
            raise SystemError("and so did its caller") from error

    monkeypatch.setattr("gcvec.vectorize", interrupted)
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "a.png")
    assert run(["vectorize", str(tmp_path / "a.png"), "-o", str(tmp_path / "a.gcv")]) == 130
