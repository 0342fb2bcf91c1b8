from __future__ import annotations

import json
import struct
import subprocess
import sys
import zipfile
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcvec.annotations import Annotations, Shape
from gcvec.errors import InputError
from gcvec.io import DEFAULT_LIMITS, check_size, read_annotations

XML = b"""<?xml version="1.0"?><annotations><image name="a.png" width="60" height="40">
<polygon label="sky" points="0,0;60,0;60,20"/></image></annotations>"""
COCO = json.dumps(
    {
        "images": [{"id": 1, "file_name": "a.png", "width": 60, "height": 40}],
        "categories": [{"id": 1, "name": "sky"}],
        "annotations": [{"image_id": 1, "category_id": 1, "segmentation": [[0, 0, 60, 0, 60, 20]]}],
    }
).encode()


def archive(entries: dict[str, bytes], compression: int = zipfile.ZIP_DEFLATED) -> bytes:
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as target:
        for name, content in entries.items():
            target.writestr(name, content)
    return buffer.getvalue()


def refusal(data: bytes, code: str) -> str:
    with pytest.raises(InputError) as error:
        read_annotations(data, limits=replace(DEFAULT_LIMITS, annotation_bytes=100_000))
    assert error.value.code == code
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    "data",
    [
        XML,
        b"\xef\xbb\xbf" + XML,
        b"\n\n  <annotations>" + XML.partition(b"<annotations>")[2],
        COCO,
        b"  \n" + COCO,
        archive({"annotations.xml": XML, "images/a.png": b"not looked at"}),
        archive({"annotations/instances_default.json": COCO}),
        archive(
            {"task/annotations.xml": XML, "task/info.json": b"{}", "__MACOSX/task/annotations.xml": b"x"}
        ),
        archive({"annotations.xml": XML}, zipfile.ZIP_STORED),
        archive({"task/._annotations.xml": b"x", "task/annotations.xml": XML}),
    ],
)
def test_the_format_is_told_by_content(data: bytes) -> None:
    annotations = read_annotations(data)
    (shape,) = annotations.shapes
    assert (annotations.width, annotations.height, shape.label) == (60, 40, "sky")
    assert shape.rings[0].tolist() == [[0, 0], [60, 0], [60, 20]]
    assert read_annotations(data, image_name="a.png").shapes
    assert read_annotations(data, picture_name="upload").shapes
    with pytest.raises(InputError, match="no image named"):
        read_annotations(data, image_name="b.png")


@pytest.mark.parametrize("data", [b"", b"   ", b"\x89PNG\r\n", b"label,x,y\nsky,0,0\n"])
def test_anything_else_is_unsupported(data: bytes) -> None:
    refusal(data, "unsupported-annotations")


@pytest.mark.parametrize(
    "name", ["../annotations.xml", "a/../../b.xml", "/etc/annotations.xml", "..\\x.xml", "C:\\x.xml"]
)
def test_path_tricks_are_refused(name: str) -> None:
    assert "unsafe path" in refusal(archive({name: XML}), "unsafe-annotations")
    refusal(archive({"annotations.xml": XML, name: b""}), "unsafe-annotations")


def test_a_zip_bomb_is_stopped_at_the_limit() -> None:
    bomb = archive({"annotations.xml": b" " * 50_000_000})
    assert len(bomb) < 100_000
    refusal(bomb, "annotations-too-large")


def test_a_zip_of_very_many_files_is_refused() -> None:
    refusal(archive({f"{i}": b"" for i in range(10_001)}, zipfile.ZIP_STORED), "unsafe-annotations")


def test_a_document_larger_than_the_limit_is_refused() -> None:
    refusal(b" " * 100_001, "annotations-too-large")


def test_a_zip_must_hold_one_annotation_file() -> None:
    refusal(archive({"images/a.png": b""}), "unsupported-annotations")
    message = refusal(archive({"train.json": COCO, "val.json": COCO}), "unsupported-annotations")
    assert "'train.json', 'val.json'" in message


def test_unusual_zips_are_refused() -> None:
    refusal(archive({"annotations.xml": XML}, zipfile.ZIP_LZMA), "unsupported-annotations")
    encrypted = bytearray(archive({"annotations.xml": XML}))
    entry = encrypted.index(b"PK\x01\x02")
    encrypted[entry + 8 : entry + 10] = struct.pack("<H", 1)
    assert "encrypted" in refusal(bytes(encrypted), "unsupported-annotations")


def test_a_damaged_zip_is_refused() -> None:
    data = archive({"annotations.xml": XML * 20}, zipfile.ZIP_STORED)
    refusal(data[: len(data) // 2], "broken-annotations")
    refusal(data.replace(b"points", b"POINTS", 1), "broken-annotations")  # its checksum no longer fits


@given(st.data())
def test_a_zip_with_flipped_bytes_reads_or_is_refused(data: st.DataObject) -> None:
    file = bytearray(archive({"annotations.xml": XML}))
    for _ in range(data.draw(st.integers(1, 4))):
        file[data.draw(st.integers(0, len(file) - 1))] = data.draw(st.integers(0, 255))
    try:
        read_annotations(bytes(file))
    except InputError as error:
        assert error.code  # noqa: PT017


def test_sizes_must_agree_where_stated() -> None:
    shape = Shape("s", rings=(np.zeros((3, 2)),))
    check_size(Annotations((shape,), 60, 40), 60, 40)
    check_size(Annotations((shape,)), 60, 40)
    with pytest.raises(InputError, match="60 x 40 pixels, this one has 40 x 60") as error:
        check_size(Annotations((shape,), 60, 40), 40, 60)
    assert error.value.code == "size-mismatch"


def test_annotations_without_a_region_are_of_no_use() -> None:
    with pytest.raises(InputError) as error:
        check_size(Annotations((), 60, 40), 60, 40)
    assert error.value.code == "no-usable-polygon"


def test_reading_needs_no_solver_library() -> None:
    code = "import gcvec.io, sys; print([m for m in ('scipy', 'numba', 'skimage') if m in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
