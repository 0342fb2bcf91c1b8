"""Files: what comes back is what was saved, and nothing but an `InputError` comes of a broken one."""

from __future__ import annotations

import contextlib
import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcvec import InputError, VectorImage
from gcvec.codec.file import VERSION, decode, encode, encode_rounded, rounded_colors, sealed
from gcvec.quantization import Quantization
from tests.gcvec.scenes import SCENES, vectorized


@cache
def file_of(scene: str) -> bytes:
    return encode(vectorized(scene))


@pytest.mark.parametrize("scene", SCENES)
def test_a_file_holds_the_whole_picture(scene: str) -> None:
    image = vectorized(scene)
    again = decode(file_of(scene))
    np.testing.assert_array_equal(again.render(), image.render())
    np.testing.assert_array_equal(again.render(2.5), image.render(2.5))
    assert (again.width, again.height, again.labels) == (image.width, image.height, image.labels)
    np.testing.assert_array_equal(again.points, image.points)
    np.testing.assert_allclose(again.colors, image.colors, atol=1e-12)
    assert encode(again) == file_of(scene)


@pytest.mark.parametrize("step", [9, 64, 200])
@pytest.mark.parametrize("scene", SCENES)
def test_colors_are_rounded_without_a_file_as_they_are_with_one(scene: str, step: int) -> None:
    image, rng = vectorized(scene), np.random.default_rng(step)
    exact = replace(
        image,
        boundary_colors=rng.uniform(0, 1, image.boundary_colors.shape),
        point_colors=rng.uniform(0, 1, image.point_colors.shape),
    ).knowing(image.canvas)
    exact = exact.in_steps(Quantization(boundary_step=step, point_step=step))
    data, *in_file = encode_rounded(exact)
    assert decode(data).quantization.point_step == step
    for rounded, expected in zip(rounded_colors(exact), in_file, strict=True):
        np.testing.assert_array_equal(rounded, expected)


@pytest.mark.parametrize("scene", ["pixel", "ring", "voronoi"])
def test_description_of_a_loaded_picture_is_the_same(scene: str) -> None:
    image, again = vectorized(scene), decode(file_of(scene))
    for part in ("format", "image", "curves"):
        assert again.description()[part] == image.description()[part]


def test_saving_and_loading(tmp_path: Path) -> None:
    vectorized("ring").save(tmp_path / "ring.gcv")
    np.testing.assert_array_equal(
        VectorImage.load(tmp_path / "ring.gcv").render(), vectorized("ring").render()
    )


def test_labels_are_any_text() -> None:
    image = vectorized("quadrants")
    labels = ("", "ÅΩ 猫", 'a "quoted" \\ one', "\n")
    assert decode(encode(replace(image, labels=labels))).labels == labels


@pytest.mark.parametrize("scene", ["ring", "pixel"])
def test_every_cut_is_refused(scene: str) -> None:
    data = file_of(scene)
    for n in {*range(min(len(data), 40)), *range(0, len(data), 37), len(data) - 1}:
        with pytest.raises(InputError):
            decode(data[:n])


def test_other_files_are_refused() -> None:
    for data in (b"", b"GC", b"GIF89a" + bytes(50)):
        with pytest.raises(InputError, match="not a gcvec file"):
            decode(data)
    with pytest.raises(InputError):
        decode(b"GCV")


@pytest.mark.parametrize("version", [0, 1, VERSION + 1, 255])
def test_other_versions_are_refused(version: int) -> None:
    with pytest.raises(InputError, match="version"):
        decode(sealed(file_of("ring")[8:], version))


def test_recolors_need_version_4() -> None:
    data = (Path(__file__).parents[2] / "data" / "recolored.gcv").read_bytes()
    assert data[3] == VERSION
    with pytest.raises(InputError, match="unknown edits"):
        decode(sealed(data[8:], 3))


@settings(max_examples=60)
@given(at=st.integers(0, 10**6), value=st.integers(1, 255))
def test_a_flipped_byte_is_noticed(at: int, value: int) -> None:
    data = bytearray(file_of("ring"))
    data[at % len(data)] ^= value
    with pytest.raises(InputError):
        decode(bytes(data))


@settings(max_examples=150)
@given(scene=st.sampled_from(["ring", "quadrants", "stripes"]), data=st.data())
def test_a_forged_file_decodes_or_is_refused(scene: str, data: st.DataObject) -> None:
    """With the checksum mended, so that the damage reaches the decoder."""
    stream = bytearray(file_of(scene)[8:])
    for _ in range(data.draw(st.integers(1, 3))):
        stream[data.draw(st.integers(0, len(stream) - 1))] ^= data.draw(st.integers(1, 255))
    end = data.draw(st.one_of(st.just(len(stream)), st.integers(0, len(stream))))
    try:
        image = decode(sealed(bytes(stream[:end])))
    except InputError:
        return
    assert image.render().shape == (image.height, image.width, 3)


@settings(max_examples=60)
@given(stream=st.binary(max_size=400))
def test_random_bytes_are_refused_or_decoded(stream: bytes) -> None:
    with contextlib.suppress(InputError):
        decode(sealed(stream))


def test_labels_of_strangers_files_are_plain_text(monkeypatch: pytest.MonkeyPatch) -> None:
    """A file may hold what is no text at all: half of a pair of code units, a number."""
    plainly = json.dumps
    monkeypatch.setattr("gcvec.codec.file.json.dumps", lambda labels, ensure_ascii: plainly(labels))
    image = VectorImage.from_bytes(file_of("ring"))
    odd = replace(image, labels=("\ud800", *image.labels[1:]))
    read = VectorImage.from_bytes(odd.to_bytes())
    assert read.labels[0] == "\ufffd"
    assert VectorImage.from_bytes(read.to_bytes()).labels == read.labels
    numbers = replace(image, labels=(7, *image.labels[1:]))
    with pytest.raises(InputError, match="labels that are no text"):
        VectorImage.from_bytes(numbers.to_bytes())
