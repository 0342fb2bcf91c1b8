"""The command itself: its help, and what it loads."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import click
import pytest

from gcvec.cli._app import root, run
from gcvec.cli._postponed import POSTPONED
from tests.command import gcvec, refused


def test_unknown_command() -> None:
    refused(gcvec("vectorise"), "vectorise")


def test_help_lists_every_command() -> None:
    run = gcvec("--help")
    assert run.returncode == 0
    for command in ("compare", "render", "serve", "submit", "vectorize"):
        assert f" {command} " in run.stdout


def test_no_command_is_bad_input_and_shows_the_help() -> None:
    run = gcvec()
    assert (run.returncode, run.stdout, run.stderr) == (2, gcvec("--help").stdout, "")


def test_an_error_that_nobody_expected_is_one_line_that_says_how_to_see_more(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise RuntimeError("dictionary changed\nsize")

    monkeypatch.setattr("gcvec.io.read_picture", fail)
    (tmp_path / "a.png").touch()
    assert run(["vectorize", str(tmp_path / "a.png"), "-o", str(tmp_path / "a.gcv")]) == 1
    told = "gcvec: failed: RuntimeError: dictionary changed size (GCVEC_TRACEBACK=1 shows where)\n"
    assert capsys.readouterr() == ("", told)


def test_every_parameter_is_explained() -> None:
    context = click.Context(root)
    commands = {name: root.get_command(context, name) for name in root.list_commands(context)}
    assert {"vectorize", "serve"} < set(commands)
    for name, command in commands.items():
        assert command is not None
        assert [parameter.name for parameter in command.params if not parameter.help] == [], name


def loaded_by(*arguments: object) -> set[str]:
    """The modules that are there at the end of a command, those still to be loaded not among them."""
    script = f"""
import sys
from importlib.util import _LazyModule

from gcvec.cli import main

sys.argv = ["gcvec", *{list(map(str, arguments))}]
try:
    main()
finally:
    print(*(name for name, module in sys.modules.items() if type(module) is not _LazyModule))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def test_a_small_picture_does_not_wait_for_what_it_does_not_need(folder: Path, tmp_path: Path) -> None:
    slow = {"scipy.linalg", "scipy.ndimage", "scipy.special", "pydantic", "skimage", *POSTPONED}
    for regions in ((), ("-a", folder / "photo.xml")):
        loaded = loaded_by("vectorize", folder / "photo.png", *regions, "-o", tmp_path / "a.gcv")
        assert {"numpy", "scipy.sparse", "gcvec.refinement.batch"} <= loaded
        assert not loaded & slow
    assert not loaded_by("regions", folder / "photo.png", "-o", tmp_path / "a.xml") & slow
