"""Automatic regions on the command line: written, read back, and the same as those of a run without them."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import skimage.data
from PIL import Image

from gcvec.cli._app import run
from gcvec.io import read_annotations, read_picture
from gcvec.partition import partition
from gcvec.segment import segment


@pytest.fixture(scope="module")
def photo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("regions") / "coffee.png"
    Image.fromarray(skimage.data.coffee()[::2, ::2]).save(path)
    return path


@pytest.mark.parametrize("ending", [".xml", ".json", ".XML"])
@pytest.mark.parametrize("count", [0, 12])
def test_regions_come_back(photo: Path, tmp_path: Path, ending: str, count: int) -> None:
    output = tmp_path / f"coffee{ending}"
    assert run(["regions", str(photo), "-o", str(output), "--regions", str(count)]) == 0
    found = segment(read_picture(photo.read_bytes()).pixels, count)
    height, width = found.labels.shape
    read = partition(read_annotations(output.read_bytes(), picture_name=photo.name), width, height)
    np.testing.assert_array_equal(read.labels, found.labels)
    assert (read.names, read.warnings) == (found.names, ())
    assert len(found.names) == count or not count


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("-o", "out.txt"), ".xml, .json"),
        (("-o", "missing/out.xml"), "no such folder"),
        (("-o", "out.xml", "--regions", "-1"), "--regions"),
        (("-o", "out.xml", "--regions", "many"), "--regions"),
    ],
)
def test_regions_refuses(photo: Path, tmp_path: Path, options: tuple[str, ...], named: str) -> None:
    command = [sys.executable, "-m", "gcvec.cli", "regions", str(photo), *options]
    refused = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, timeout=60)
    assert refused.returncode == 2
    assert refused.stdout == ""
    assert refused.stderr.startswith("gcvec: ")
    assert refused.stderr.count("\n") == 1
    assert named in refused.stderr
    assert list(tmp_path.iterdir()) == []
