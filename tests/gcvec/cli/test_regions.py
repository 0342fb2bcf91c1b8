"""Automatic regions on the command line: written, read back, and the same as those of a run without them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import skimage.data
from PIL import Image

from gcvec.automatic_regions import automatic_regions
from gcvec.cli._app import run
from gcvec.io import DEFAULT_LIMITS, read_annotations, read_picture
from gcvec.options import Options
from gcvec.regions.components import SLIVER_AREA
from gcvec.regions.partition import partition
from tests.command import gcvec, refused


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
    found = automatic_regions(read_picture(photo.read_bytes()).pixels, Options(regions=count))
    height, width = found.labels.shape
    read = partition(read_annotations(output.read_bytes(), picture_name=photo.name), width, height)
    np.testing.assert_array_equal(read.labels, found.labels)
    assert (read.names, read.warnings) == (found.names, ())
    assert len(found.names) == count or not count


def test_no_more_regions_are_written_than_are_read(photo: Path, tmp_path: Path) -> None:
    """More are asked for than there are that are no slivers, which vectorize would drop."""
    Image.open(photo).crop((100, 50, 160, 100)).save(tmp_path / "part.png")
    output = tmp_path / "part.xml"
    assert run(["regions", str(tmp_path / "part.png"), "-o", str(output), "--regions", "1000"]) == 0
    drawn = read_annotations(output.read_bytes())
    read = partition(drawn, 60, 50)
    assert 20 < len(read.names) == len(drawn.shapes) < 60 * 50 / SLIVER_AREA
    assert read.warnings == ()


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
    refused(gcvec("regions", photo, *options, cwd=tmp_path), named)
    assert list(tmp_path.iterdir()) == []


def test_what_is_found_by_itself_can_always_be_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """More regions than annotations may hold: the picture is divided into as many as they may."""
    noise = np.random.default_rng(5).integers(0, 256, (30, 30, 3), dtype=np.uint8).repeat(7, 0).repeat(7, 1)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    most = 40
    assert len(automatic_regions(noise, Options()).names) > most
    limits = replace(DEFAULT_LIMITS, max_polygons=most)
    monkeypatch.setenv("GCVEC_MAX_POLYGONS", str(most))
    for ending in ("xml", "json"):
        output = tmp_path / f"noise.{ending}"
        assert run(["regions", str(tmp_path / "noise.png"), "-o", str(output)]) == 0
        assert len(read_annotations(output.read_bytes(), limits=limits).shapes) == most
        code = run(["regions", str(tmp_path / "noise.png"), "-o", str(output), "--regions", str(most + 1)])
        assert code == 2
