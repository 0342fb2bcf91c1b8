"""`gcvec compare`: the figures of the report."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from tests.command import gcvec, refused


@pytest.mark.usefixtures("vectorized")
def test_compare(folder: Path) -> None:
    run = gcvec("compare", folder / "photo.png", folder / "photo.gcv", "--json")
    assert (run.returncode, run.stderr) == (0, "")
    measured, report = json.loads(run.stdout), json.loads((folder / "r.json").read_text())
    names = ("mse", "mse_raw", "mae", "psnr", "ssim", "patches", "points", "bytes", "foldovers")
    assert tuple(measured) == names
    assert measured == pytest.approx({name: report[name] for name in names}, abs=1e-6)
    lines = gcvec("compare", folder / "photo.png", folder / "photo.gcv").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(names)


@pytest.mark.usefixtures("vectorized")
def test_compare_refuses_another_size(folder: Path, tmp_path: Path) -> None:
    Image.new("RGB", (10, 10)).save(tmp_path / "small.png")
    refused(gcvec("compare", tmp_path / "small.png", folder / "photo.gcv"), "photo.gcv", "10 x 10", "64 x 48")
