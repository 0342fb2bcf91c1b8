"""Section 5: settings."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import httpx
import pytest
from PIL import Image

from gcvec.errors import InputError
from tests.command import GCVEC, gcvec
from tests.command import refused as refused_by_command
from tests.contract.client import post
from tests.picture_files import encoded
from tests.problems import refused
from tests.shaded_box import BOX, GROUND, cvat, photo_pixels, polygon
from worker.settings import Settings, get_settings

NAMES = [f"GCVEC_{name.upper()}" for name in Settings.model_fields]
ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text()


@pytest.mark.contract("5: listed by gcvec serve --help and README")
def test_every_setting_is_listed() -> None:
    assert {"GCVEC_BROKER_URL", "GCVEC_STORAGE_URL", "GCVEC_API_KEYS", "GCVEC_RETENTION"} <= set(NAMES)
    shown = gcvec("serve", "--help").stdout
    for name in NAMES:
        assert re.search(rf"\b{name} \(", shown), name
        assert f"| `{name}` |" in README


@pytest.mark.contract("5: one settings class")
def test_no_other_variable_is_read() -> None:
    """Apart from the command line's own: the key `submit` sends, and the switch that shows a traceback."""
    sources = [file for package in ("gcvec", "worker", "service") for file in (ROOT / package).rglob("*.py")]
    named = {name for file in sources for name in re.findall(r"\bGCVEC_[A-Z_]+\b", file.read_text())}
    assert named - set(NAMES) <= {"GCVEC_API_KEY", "GCVEC_TRACEBACK", "GCVEC_"}


@pytest.mark.contract("5: a wrong setting")
@pytest.mark.parametrize(
    "setting",
    [
        *("GCVEC_MAX_SIDE=wide", "GCVEC_RETENTION=soon", "GCVEC_API_KEYS=short", "GCVEC_MATTE=white"),
        *("GCVEC_API_KEYS=,", "GCVEC_API_KEYS= ", "GCVEC_CORS_ORIGINS= , "),
        *("GCVEC_BROKER_URL=amqp://127.0.0.1", "GCVEC_BROKER_URL=127.0.0.1:6379"),
        *("GCVEC_BROKER_URL=redis://:secret/@127.0.0.1/0", "GCVEC_BROKER_URL=redis://127.0.0.1/x"),
        *("GCVEC_STORAGE_URL=/data", "GCVEC_STORAGE_URL=ftp://host/data", "GCVEC_STORAGE_URL=file://data"),
        "GCVEC_STORAGE_URL=s3:///prefix",
        *("GCVEC_ORPHAN_AGE=0", "GCVEC_RETENTION=-P1D", "GCVEC_WEBHOOK_PAUSES=5,-5"),
        "GCVEC_MAX_PIXELS=67108865",
    ],
)
def test_a_wrong_setting_is_named(monkeypatch: pytest.MonkeyPatch, setting: str) -> None:
    name, _, value = setting.partition("=")
    monkeypatch.setenv(name, value)
    with pytest.raises(InputError) as told:
        get_settings.__wrapped__()  # the others of this process go on with theirs
    assert name in str(told.value)
    assert "\n" not in str(told.value)
    assert "secret" not in str(told.value)


def test_the_service_names_a_wrong_setting(tmp_path: Path) -> None:
    wrong = {**os.environ, "GCVEC_BROKER_URL": "redis://:secret/@127.0.0.1/0"}
    run = gcvec("serve", "--port", "0", "--data", tmp_path / "data", env=wrong)
    refused_by_command(run, "GCVEC_BROKER_URL")
    assert "secret" not in run.stderr


def test_the_data_folder_is_a_setting_too(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    command = ["env", f"GCVEC_DATA_DIR={file}", *GCVEC, "serve", "--port", "0"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert run.returncode == 2
    assert str(file) in run.stderr


def test_the_api_by_itself_names_a_wrong_setting_too() -> None:
    command = ["env", "GCVEC_STORAGE_URL=/data", sys.executable, "-m", "service.server", "127.0.0.1:0"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (run.returncode, run.stdout, run.stderr.count("\n")) == (2, "", 1)
    assert run.stderr.startswith("gcvec: GCVEC_STORAGE_URL: must be like file:///folder")


@pytest.mark.parametrize("setting", ["GCVEC_STORAGE_URL", "GCVEC_DATA_DIR"])
@pytest.mark.parametrize(
    "program", [[*GCVEC, "serve", "--port", "0"], [sys.executable, "-m", "service.server", "127.0.0.1:0"]]
)
def test_a_folder_that_cannot_be_written_to_is_named_at_the_start(
    tmp_path: Path, setting: str, program: list[str]
) -> None:
    """Not at the first upload."""
    (tmp_path / "file").touch()
    folder = tmp_path / "file" / "store"
    value = folder.as_uri() if setting == "GCVEC_STORAGE_URL" else str(folder)
    variables = {"GCVEC_DATA_DIR": str(tmp_path / "data"), setting: value}
    command = ["env", *(f"{name}={value}" for name, value in variables.items()), *program]
    run = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.splitlines()[-1].startswith(f"gcvec: {setting}: {folder}")
    assert run.stderr.count(setting) == 1


@pytest.mark.parametrize(
    "good",
    [
        *(
            {"broker_url": f"{start}/0"}
            for start in ("redis://h:6379", "rediss://me:secret@h", "redis://[::1]")
        ),
        *({"broker_url": url} for url in ("redis://", "redis://h", "redis://h/?health_check_interval=5")),
        *({"matte": color} for color in ("#ffFF00", "ffff00")),
        *({"storage_url": url} for url in ("", "file:///data", "s3://bucket", "s3://bucket/prefix")),
    ],
    ids=str,
)
def test_what_can_be_used_is_accepted(good: dict[str, str]) -> None:
    assert Settings(**good)


@pytest.mark.service
@pytest.mark.contract("5: limits are settings")
def test_limits_are_those_that_are_set(guarded: httpx.Client, photo: bytes) -> None:
    """The limits of `SMALL_LIMITS`; a picture and annotations at each of them are fine."""
    line = ";".join(f"{x},{x % 2}" for x in range(11))
    five = polygon("1,1;9,1;9,9;5,5;1,9")
    too_many = ([BOX, BOX, BOX, BOX], [polygon(line)], [GROUND, BOX, five])
    for number, (polygons, at) in enumerate(zip(too_many, (4, 1, 3), strict=True)):
        found = refused(post(guarded, photo, cvat(*polygons)), 413, "annotations-too-large")
        assert found["pointer"].startswith(f"polygon {at}, line "), number
    assert post(guarded, photo, cvat(GROUND, BOX, BOX)).status_code == 202
    for size in ((301, 10), (230, 220)):
        picture = encoded(Image.new("L", size))
        assert refused(post(guarded, picture), 413, "picture-too-large")["pointer"] == "/image"
    assert post(guarded, photo + bytes(100_000 - len(photo))).status_code == 202
    padded = photo + bytes(100_001 - len(photo))
    assert refused(post(guarded, padded), 413, "too-large")["pointer"] == "/image"
    assert photo_pixels().size < 50_000
