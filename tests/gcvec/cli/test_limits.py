"""Limits on the command line: the service's variables, its defaults, and what a file can hold."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcvec.cli._app import run
from gcvec.cli._limits import VARIABLES, limits
from gcvec.io import DEFAULT_LIMITS
from worker.settings import Settings
from worker.settings import limits as service_limits

REGIONS = """<annotations><image id="0" name="photo.png" width="40" height="30">
<polygon label="left" points="0,0;20,0;20,30;0,30"/>
<polygon label="right" points="20,0;40,0;40,30;30,30;20,30"/></image></annotations>"""


@pytest.fixture
def command(tmp_path: Path) -> list[str]:
    Image.fromarray(np.full((30, 40, 3), 90, np.uint8)).save(tmp_path / "photo.png")
    (tmp_path / "photo.xml").write_text(REGIONS)
    files = (tmp_path / "photo.png", "-a", tmp_path / "photo.xml", "-o", tmp_path / "photo.gcv")
    return ["vectorize", *map(str, files)]


@pytest.mark.parametrize(
    ("variable", "enough", "file"),
    [
        ("GCVEC_MAX_PIXELS", 1200, "photo.png"),
        ("GCVEC_MAX_SIDE", 40, "photo.png"),
        ("GCVEC_MAX_POLYGONS", 2, "photo.xml"),
        ("GCVEC_MAX_POLYGON_VERTICES", 5, "photo.xml"),
        ("GCVEC_MAX_VERTICES", 9, "photo.xml"),
        ("GCVEC_MAX_UPLOAD_BYTES", len(REGIONS), "photo.xml"),
    ],
)
def test_a_limit_is_the_variable(
    command: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    variable: str,
    enough: int,
    file: str,
) -> None:
    monkeypatch.setenv(variable, str(enough))
    assert run(command) == 0
    monkeypatch.setenv(variable, str(enough - 1))
    assert run(command) == 2
    assert f"/{file}: " in capsys.readouterr().err


@pytest.mark.parametrize("variable", VARIABLES.values())
@pytest.mark.parametrize("value", ["", "0", "-5", "1e6", "many"])
def test_a_wrong_limit_is_named(
    command: list[str],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    variable: str,
    value: str,
) -> None:
    monkeypatch.setenv(variable, value)
    assert run(command) == 2
    assert capsys.readouterr().err == f"gcvec: {variable}: must be a whole number above 0, not {value!r}\n"


def test_limits_are_those_of_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    assert limits() == service_limits(Settings()) == DEFAULT_LIMITS
    for number, variable in enumerate(VARIABLES.values(), start=7):
        monkeypatch.setenv(variable, f"{number}_000")
    assert limits().max_pixels == 7000
    assert limits() == service_limits(Settings())


def test_what_a_file_cannot_hold_is_refused_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    picture, annotations = tmp_path / "large.png", tmp_path / "large.xml"
    Image.new("1", (8193, 8192)).save(picture)
    annotations.write_text(REGIONS.replace("photo.png", "large.png"))
    monkeypatch.setenv("GCVEC_MAX_PIXELS", "100000000")
    command = ["vectorize", str(picture), "-a", str(annotations), "-o", str(tmp_path / "a.gcv")]
    assert run(command) == 2
    told = capsys.readouterr().err
    assert told.startswith(f"gcvec: {picture}: the picture has 8193 x 8192 pixels, a vector image holds")
