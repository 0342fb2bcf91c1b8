"""A file written long ago, and the picture it holds: what decoders, this one included, must keep to."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage
from gcvec.codec.file import encode

DATA = Path(__file__).parent.parent / "data"


both = pytest.mark.parametrize("name", ["leaf", "recolored"])


@pytest.mark.parametrize("name", ["leaf", "recolored", "leaf-5", "recolored-5"])
def test_the_golden_file_holds_its_picture(name: str) -> None:
    image = VectorImage.load(DATA / f"{name}.gcv")
    with Image.open(DATA / f"{name}.png") as picture:
        expected = np.asarray(picture.convert("RGB"), np.int64)
    assert np.abs(image.render() - expected).max() <= 1


def test_the_golden_file_has_every_feature() -> None:
    """Holes, soft and hard curves, junctions, interior points, and an edit."""
    image = VectorImage.load(DATA / "leaf.gcv")
    assert any(len(loops) > 1 for loops in image.network.loops)
    inner = [(curve.closed, bool(hard)) for curve, hard in zip(image.curves, image.hard, strict=True)]
    assert {closed for closed, _ in inner} == {True, False}
    assert {hard for _, hard in inner} == {True, False}
    assert len(image.points) > 100
    assert image.control_points is not None
    assert image.foldovers == 0


def test_the_recolored_golden_file_has_hardened_curves() -> None:
    image = VectorImage.load(DATA / "recolored.gcv")
    assert image.recoloring is not None
    assert image.hard.sum() > image.recoloring.original.hard.sum()
    assert len(image.points) > 20


@both
def test_the_golden_file_is_written_again_byte_by_byte(name: str) -> None:
    data = (DATA / f"{name}.gcv").read_bytes()
    assert encode(VectorImage.from_bytes(data)) == data


@pytest.mark.parametrize(("name", "version"), [("leaf", 3), ("leaf", 5), ("recolored", 4), ("recolored", 5)])
def test_a_file_of_an_older_version_is_read_alike(name: str, version: int) -> None:
    old = (DATA / f"{name}-{version}.gcv").read_bytes()
    assert old[3] == version
    assert encode(VectorImage.from_bytes(old)) == (DATA / f"{name}.gcv").read_bytes()


def test_a_file_of_version_2_is_read_alike() -> None:
    data = (DATA / "leaf-3.gcv").read_bytes()
    old = VectorImage.from_bytes(b"GCV\x02" + struct.pack("<I", zlib.crc32(data[8:])) + data[8:])
    assert encode(old) == (DATA / "leaf.gcv").read_bytes()
    np.testing.assert_array_equal(old.render(), VectorImage.from_bytes(data).render())
