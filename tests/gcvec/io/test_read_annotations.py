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
from gcvec.io import DEFAULT_LIMITS, check_size, image_name_for, read_annotations
from tests.gcvec.io.single_documents import read_or_refused

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


def test_a_zip_must_hold_annotations() -> None:
    refusal(archive({"images/a.png": b""}), "unsupported-annotations")
    assert "has no 'images'" in refusal(
        archive({"a.json": b"{}", "b.json": b"{}"}), "unsupported-annotations"
    )


def coco(*names: str, label: str = "sky", bare: bool = False) -> bytes:
    """Annotations of images of these names, a region each unless they are `bare`."""
    images = [{"id": i, "file_name": name, "width": 60, "height": 40} for i, name in enumerate(names)]
    annotations = [
        {"image_id": i, "category_id": 1, "segmentation": [[0, 0, 60, 0, 60, 20]]} for i in range(len(names))
    ]
    categories = [{"id": 1, "name": label}]
    return json.dumps(
        {"images": images, "categories": categories, "annotations": [] if bare else annotations}
    ).encode()


def cvat(*names: str, label: str = "sky") -> bytes:
    polygon = f'<polygon label="{label}" points="0,0;60,0;60,20"/>'
    images = [f'<image name="{name}" width="60" height="40">{polygon}</image>' for name in names]
    return f"<annotations>{''.join(images)}</annotations>".encode()


SUBSETS = {
    "annotations/instances_Train.json": coco("a.png", "b.png", label="train"),
    "annotations/instances_Validation.json": coco("a.png", "c.png", label="validation"),
    "annotations/instances_Test.json": coco(),
}
TASKS = {
    "task1/annotations.xml": cvat("a.png", "b.png", label="1"),
    "task2/annotations.xml": cvat("a.png", "c.png", label="2"),
}
FILES_OF_SUBSETS = {"Train.xml": cvat("a.png", label="t"), "Test.xml": cvat("a.png", "c.png", label="test")}
IN_FOLDERS = {
    "train/_annotations.coco.json": coco("a.jpg", label="train"),
    "valid/_annotations.coco.json": coco("a.jpg", label="valid"),
}


@pytest.mark.parametrize(
    ("files", "name", "label"),
    [
        (SUBSETS, "b.png", "train"),
        (SUBSETS, "c.png", "validation"),
        (SUBSETS, "/home/project/images/Train/a.png", "train"),
        (SUBSETS, "Validation/a.png", "validation"),
        (SUBSETS, "images/Validation/a.jpg", "validation"),
        (TASKS, "c.png", "2"),
        (TASKS, "task1/a.png", "1"),
        (FILES_OF_SUBSETS, "images/Test/a.png", "test"),
        (FILES_OF_SUBSETS, "c.jpg", "test"),
        (IN_FOLDERS, "somewhere/valid/a.jpg", "valid"),
    ],
)
def test_of_several_files_in_a_zip_the_one_that_lists_the_picture_is_taken(
    files: dict[str, bytes], name: str, label: str
) -> None:
    for names in ({"image_name": name}, {"picture_name": name}):
        annotations = read_annotations(archive(files), **names)
        assert [shape.label for shape in annotations.shapes] == [label]


@pytest.mark.parametrize(
    ("files", "path", "name", "label"),
    [
        (SUBSETS, "/home/me/images/Train/a.png", "Train/a.png", "train"),
        (SUBSETS, "/home/me/images/Validation/a.jpg", "Validation/a.png", "validation"),
        (SUBSETS, "/home/me/images/Train/c.png", None, "validation"),
        (TASKS, "/home/me/task2/a.png", "task2/a.png", "2"),
        (IN_FOLDERS, "/home/me/valid/a.jpg", "valid/a.jpg", "valid"),
        ({"a.json": coco("a/b.png", "b.png", label="both")}, "/home/me/a/b.png", "a/b.png", "both"),
    ],
)
def test_what_folders_tell_apart_has_a_name_that_does(
    files: dict[str, bytes], path: str, name: str | None, label: str
) -> None:
    zipped = archive(files)
    assert image_name_for(zipped, path) == name
    found = read_annotations(zipped, image_name=name, picture_name=path.rpartition("/")[2])
    assert [shape.label for shape in found.shapes] == [label]
    with pytest.raises(InputError):
        image_name_for(zipped, "/home/me/x/nothing.png")


def test_a_picture_that_none_or_several_files_list_is_an_error_that_says_so() -> None:
    zipped = archive(SUBSETS)
    with pytest.raises(InputError, match=r"several images match 'a.png' .*'Train/a.png', 'Validation/a.png'"):
        read_annotations(zipped, picture_name="/home/me/a.png")
    with pytest.raises(InputError, match=r"no image named 'x.png' .*'Train/a.png', 'b.png', 'Val.*, 'c.png'"):
        read_annotations(zipped, image_name="x.png")
    with pytest.raises(InputError, match="several images and none named like the picture") as error:
        read_annotations(zipped, picture_name="x.png")
    assert error.value.code == "unknown-image"
    alone = {"instances_a.json": coco("a.png"), "instances_b.json": coco()}
    assert read_annotations(archive(alone), picture_name="x.png").shapes


@pytest.mark.parametrize(
    "others",
    [
        {"annotations/person_keypoints_Train.json": coco("a.png", bare=True)},
        {"annotations/captions_Train.json": b"{", "annotations/labels_Train.json": b"x" * 200_000},
        {"panoptic_Train.json": coco("a.png", bare=True), "image_info_Train.json": coco("a.png", bare=True)},
        {"annotations/stuff_Train.json": coco("a.png", label="stuff"), "info.json": b"{}"},
        {"images/a.xml": b"<annotation/>", "images/b.xml": b"<html/>"},
    ],
)
def test_files_of_other_kinds_are_not_in_the_way(others: dict[str, bytes]) -> None:
    data = archive({**others, "annotations/instances_Train.json": COCO})
    annotations = read_annotations(
        data, image_name="a.png", limits=replace(DEFAULT_LIMITS, annotation_bytes=100_000)
    )
    assert [shape.label for shape in annotations.shapes] == ["sky"]


def test_what_is_no_annotation_is_passed_over_whatever_its_name_and_what_may_be_is_named() -> None:
    files = {"info.json": b"{}", "a.json": coco("a.png", label="a"), "classes.json": b"[]"}
    assert read_annotations(archive(files)).shapes[0].label == "a"
    both = {"person_keypoints_a.json": coco("a.png", bare=True), "labels_a.json": coco("a.png", bare=True)}
    assert read_annotations(archive(both)).shapes == ()
    assert "'b.json': broken" in refusal(archive({**files, "b.json": b"{"}), "broken-annotations")
    wrong = {"a.json": coco("a.png"), "b.json": coco("b.png").replace(b"[0, 0, 60, 0,", b'["x", 0, 60, 0,')}
    assert read_annotations(archive(wrong), image_name="a.png").shapes
    with pytest.raises(InputError, match=r"^'b.json': annotations\[0\]") as error:
        read_annotations(archive(wrong), image_name="b.png")
    assert error.value.pointer == "annotations[0]"


def test_the_files_in_a_zip_are_no_larger_together_than_one_may_be() -> None:
    half = coco("a.png") + b" " * 50_000
    assert "larger" in refusal(archive({"a.json": half, "b.json": half}), "annotations-too-large")


@pytest.mark.parametrize(
    "data",
    [
        coco(*["a.png"] * 1_001, bare=True),
        cvat(*["a.png"] * 1_001).replace(b'<polygon label="sky" points="0,0;60,0;60,20"/>', b""),
        archive({f"{i}.json": coco(*["a.png"] * 501, bare=True) for i in range(2)}),
    ],
)
def test_more_images_than_real_annotations_list_are_refused(data: bytes) -> None:
    assert "more than 1000 images" in refusal(data, "annotations-too-large")


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
    found = read_or_refused(lambda: read_annotations(bytes(file)))
    assert not isinstance(found, InputError) or found.code


def test_sizes_must_agree_where_stated() -> None:
    shape = Shape("s", rings=(np.zeros((3, 2)),))
    check_size(Annotations((shape,), 60, 40), 60, 40)
    check_size(Annotations((shape,)), 60, 40)
    with pytest.raises(InputError, match="60 x 40 pixels, this one has 40 x 60") as error:
        check_size(Annotations((shape,), 60, 40), 40, 60)
    assert error.value.code == "size-mismatch"


@pytest.mark.parametrize(("width", "height", "told"), [(60, 0, "60 pixels wide"), (0, 40, "40 pixels high")])
def test_a_side_that_is_stated_alone_must_agree(width: int, height: int, told: str) -> None:
    annotations = Annotations((Shape("s", rings=(np.zeros((3, 2)),)),), width, height)
    check_size(annotations, 60, 40)
    with pytest.raises(InputError, match=f"for a picture {told}, this one has 61 x 41"):
        check_size(annotations, 61, 41)


def test_annotations_without_a_region_are_of_no_use() -> None:
    with pytest.raises(InputError) as error:
        check_size(Annotations((), 60, 40), 60, 40)
    assert error.value.code == "no-usable-polygon"


def test_reading_needs_no_solver_library() -> None:
    code = "import gcvec.io, sys; print([m for m in ('scipy', 'numba', 'skimage') if m in sys.modules])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[]"
