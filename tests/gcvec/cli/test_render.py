"""`gcvec render`: every ending, and what is refused."""

from __future__ import annotations

import json
import resource
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.command import GCVEC, gcvec, refused
from tests.picture_files import pixels


@pytest.mark.usefixtures("vectorized")
@pytest.mark.parametrize(("scale", "size"), [("1", (64, 48)), ("2.5", (160, 120))])
def test_render_png(folder: Path, tmp_path: Path, scale: str, size: tuple[int, int]) -> None:
    run = gcvec("render", folder / "photo.gcv", "-o", tmp_path / "a.PNG", "--scale", scale)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    with Image.open(tmp_path / "a.PNG") as picture:
        assert (picture.format, picture.size) == ("PNG", size)


@pytest.mark.usefixtures("vectorized")
def test_raw_samples_pixel_centres(folder: Path, tmp_path: Path) -> None:
    for name, option in (("raw.png", ["--raw"]), ("box.png", [])):
        assert gcvec("render", folder / "photo.gcv", "-o", tmp_path / name, *option).returncode == 0
    assert not np.array_equal(pixels(tmp_path / "raw.png"), pixels(tmp_path / "box.png"))


@pytest.mark.usefixtures("vectorized")
def test_render_json(folder: Path, tmp_path: Path) -> None:
    assert gcvec("render", folder / "photo.gcv", "-o", tmp_path / "a.json").returncode == 0
    description = json.loads((tmp_path / "a.json").read_text())
    assert description["format"] == "gcvec/1"
    assert {patch["label"] for patch in description["patches"]} == {"ground", "box"}


@pytest.mark.usefixtures("vectorized")
@pytest.mark.parametrize(("ending", "magic"), [("svg", b"<?xml"), ("pdf", b"%PDF-1.4"), ("glb", b"glTF")])
def test_render_documents(folder: Path, tmp_path: Path, ending: str, magic: bytes) -> None:
    file = tmp_path / f"a.{ending}"
    run = gcvec("render", folder / "photo.gcv", "-o", file)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert file.read_bytes().startswith(magic)


@pytest.mark.usefixtures("vectorized")
@pytest.mark.parametrize(
    "options",
    [
        ("-o", "a.bmp"),
        ("-o", "a"),
        ("-o", "a.png", "--scale", "0"),
        ("-o", "a.png", "--scale", "nan"),
        ("-o", "a.png", "--scale", "1e6"),
        ("-o", "a.json", "--raw"),
        ("-o", "nowhere/a.png"),
    ],
)
def test_render_refuses(folder: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    refused(gcvec("render", folder / "photo.gcv", *options, cwd=tmp_path))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.usefixtures("vectorized")
def test_a_huge_scale_makes_no_long_line(folder: Path, tmp_path: Path) -> None:
    run = gcvec("render", folder / "photo.gcv", "-o", tmp_path / "a.png", "--scale", "1e300")
    refused(run, "6.4e+301 x 4.8e+301 pixels are too many")


def test_broken_vector_image(tmp_path: Path) -> None:
    broken = tmp_path / "a.gcv"
    for content in (b"", b"not a vector image", bytes(1000)):
        broken.write_bytes(content)
        refused(gcvec("render", broken, "-o", tmp_path / "a.png"), broken)


@pytest.mark.usefixtures("vectorized")
def test_failed_write_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    command = [*GCVEC, "render", folder / "photo.gcv", "-o", tmp_path / "a.json"]
    run = subprocess.run(command, capture_output=True, text=True, preexec_fn=_forbid_files_over_1_kb)
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith("gcvec: ")
    assert run.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def _forbid_files_over_1_kb() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
