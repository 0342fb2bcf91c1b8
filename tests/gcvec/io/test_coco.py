from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gcvec.errors import InputError
from gcvec.io import DEFAULT_LIMITS
from gcvec.regions.partition import partition
from tests.gcvec.io.single_documents import read_coco, read_or_refused


def document(*annotations: dict[str, Any], **image: Any) -> dict[str, Any]:
    return {
        "images": [{"id": 7, "file_name": "a.png", "width": 60, "height": 40, **image}],
        "categories": [{"id": 1, "name": "sky"}],
        "annotations": [{"id": i, "image_id": 7, "category_id": 1, **a} for i, a in enumerate(annotations)],
    }


def encoded(value: Any) -> bytes:
    return json.dumps(value).encode()


def refusal(value: Any) -> InputError:
    with pytest.raises(InputError) as error:
        read_coco(value if isinstance(value, bytes) else encoded(value))
    assert "\n" not in str(error.value)
    return error.value


LEFT = [0, 0, 20, 0, 20, 40, 0, 40]
RIGHT = [40, 0, 60, 0, 60.0, 40, 40, 40]


def test_polygons_carry_category_and_pointer() -> None:
    annotations = read_coco(
        encoded(document({"segmentation": [LEFT]}, {"segmentation": [RIGHT], "category_id": 9}))
    )
    assert (annotations.width, annotations.height, annotations.warnings) == (60, 40, ())
    assert [shape.label for shape in annotations.shapes] == ["sky", "9"]
    assert [shape.pointer for shape in annotations.shapes] == ["annotations[0]", "annotations[1]"]
    assert annotations.shapes[0].rings[0].tolist() == [[0, 0], [20, 0], [20, 40], [0, 40]]


def test_rings_are_parts_of_one_region() -> None:
    annotations = read_coco(
        encoded(document({"segmentation": [LEFT, RIGHT, [15, 0, 45, 0, 45, 40, 15, 40]]}))
    )
    assert partition(annotations, 60, 40).names == ("sky",)


@pytest.mark.parametrize("counts", [[4, 14, 6], [4.0, 14, 6.0], "4>6"])
def test_run_lengths_go_down_the_columns(counts: object) -> None:
    # 6 wide, 4 high; columns 1 to 3 in full, of column 4 the upper half
    value = document({"segmentation": {"size": [4, 6], "counts": counts}}, width=6, height=4)
    (shape,) = read_coco(encoded(value)).shapes
    assert shape.offset == (1, 0)
    assert shape.mask is not None
    assert shape.mask.astype(int).tolist() == [[1, 1, 1, 1], [1, 1, 1, 1], [1, 1, 1, 0], [1, 1, 1, 0]]


@pytest.mark.parametrize("counts", [[2400], [2400.0], [2400, 0]])
def test_an_empty_mask_is_dropped_with_a_warning(counts: list[float]) -> None:
    empty = {"segmentation": {"size": [40, 60], "counts": counts}}
    found = partition(read_coco(encoded(document({"segmentation": [LEFT]}, empty))), 60, 40)
    assert found.warnings == ("1 shape dropped: its mask is empty (annotations[1])",)


def test_a_mask_brings_its_own_size_where_the_image_states_none() -> None:
    value = document({"segmentation": {"size": [4, 6], "counts": [0, 24]}})
    del value["images"][0]["width"], value["images"][0]["height"]
    annotations = read_coco(encoded(value))
    assert (annotations.width, annotations.height) == (0, 0)
    assert annotations.shapes[0].mask is not None
    assert annotations.shapes[0].mask.shape == (4, 6)


@pytest.mark.parametrize("stated", ["width", "height"])
def test_a_mask_has_the_side_of_the_image_that_is_stated(stated: str) -> None:
    value = document({"segmentation": {"size": [4, 6], "counts": [0, 24]}}, width=6, height=4)
    value["images"][0] = {"id": 7, "file_name": "a.png", stated: value["images"][0][stated]}
    assert read_coco(encoded(value)).shapes[0].mask is not None
    value["images"][0][stated] = 5
    own = {"width": "6 pixels wide", "height": "4 pixels high"}[stated]
    assert str(refusal(value)).endswith(f"its mask is {own}, the picture 5")


@pytest.mark.parametrize("nothing", [None, [], [[]], [[], []]])
def test_a_box_alone_is_a_rectangle_and_neither_is_left_out(nothing: list[Any]) -> None:
    annotations = read_coco(
        encoded(document({"segmentation": nothing, "bbox": [5, 6, 10, 20]}, {"keypoints": [1, 2, 3]}))
    )
    (shape,) = annotations.shapes
    assert shape.rings[0].tolist() == [[5, 6], [15, 6], [15, 26], [5, 26]]
    assert annotations.warnings == ("1 annotation without a region left out",)


@pytest.mark.parametrize("nothing", [{}, *({"segmentation": none} for none in (None, [], [[]]))])
def test_keypoints_alone_are_left_out_box_and_all(nothing: dict[str, Any]) -> None:
    points = {"keypoints": [5, 6, 2, 15, 26, 2], "num_keypoints": 2, "bbox": [5, 6, 10, 20]}
    read = read_coco(
        encoded(document({"segmentation": [LEFT]}, {**points, **nothing}, {**points, **nothing}))
    )
    assert [shape.pointer for shape in read.shapes] == ["annotations[0]"]
    assert read.warnings == ("2 annotations without a region left out",)


def test_keypoints_beside_an_outline_or_none_of_them_do_not_matter() -> None:
    beside = {"segmentation": [LEFT], "keypoints": [5, 6, 2]}
    read = read_coco(encoded(document(beside, {"keypoints": [], "bbox": [30, 6, 10, 20]})))
    assert [len(shape.rings[0]) for shape in read.shapes] == [4, 4]
    assert read.warnings == ()


@pytest.mark.parametrize("bbox", [None, []])
def test_no_box_is_none_however_it_is_written(bbox: object) -> None:
    read = read_coco(encoded(document({"segmentation": [LEFT]}, {"segmentation": None, "bbox": bbox})))
    assert len(read.shapes) == len(read.warnings) == 1
    (_, empty) = read_coco(
        encoded(document({"bbox": [5, 6, 10, 20]}, {"segmentation": [[]], "bbox": bbox}))
    ).shapes
    assert empty.rings[0].shape == (0, 2)


def test_the_image_is_chosen_by_name_and_its_annotations_by_id() -> None:
    value = document({"segmentation": [LEFT]}, {"segmentation": [RIGHT], "image_id": "other"})
    value["images"].append({"id": "other", "file_name": "sub/b.png", "width": 60, "height": 40})
    assert read_coco(encoded(value), image_name="a.png").shapes[0].pointer == "annotations[0]"
    assert read_coco(encoded(value), picture_name="b.png").shapes[0].pointer == "annotations[1]"
    assert refusal(value).code == "unknown-image"


@pytest.mark.parametrize(
    "annotation",
    [
        {"segmentation": "polygon"},
        {"segmentation": [1, 2, 3]},
        {"segmentation": [[1, 2, 3]]},
        {"segmentation": [[1, "two"]]},
        {"segmentation": [[1, None]]},
        {"segmentation": [[1, True, 5, 5, 1, 9]]},
        {"segmentation": [[1, "\u0661", 5, 5, 1, 9]]},
        {"bbox": [1, 2, 3, "1_0"]},
        {"segmentation": [[[1, 2], [3, 4]]]},
        {"segmentation": [[1, 10**400, 2, 3]]},
        {"segmentation": {"size": [40, 60]}},
        {"segmentation": {"size": [60, 40], "counts": [2400]}},
        {"segmentation": {"size": [40], "counts": [2400]}},
        {"segmentation": {"size": [40, 60], "counts": [2399]}},
        {"segmentation": {"size": [40, 60], "counts": [2401, -1]}},
        {"segmentation": {"size": [40, 60], "counts": [2399.5, 0.5]}},
        {"segmentation": {"size": [40, 60], "counts": []}},
        {"segmentation": {"size": [40, 60], "counts": ""}},
        {"segmentation": {"size": [40, 60], "counts": None}},
        {"segmentation": [None]},
        {"segmentation": {"size": [40, 60], "counts": [2400, None]}},
        {"segmentation": {"size": [40, 60], "counts": [[2400], [1, 2]]}},
        {"segmentation": {"size": [40, 60], "counts": [10**400]}},
        {"segmentation": {"size": [40, 60], "counts": "o"}},
        {"segmentation": {"size": [40, 60], "counts": "0"}},
        {"bbox": [1, 2, 3]},
        {"bbox": "everything"},
        {"bbox": [10, 10, -5, 20]},
        {"bbox": [1, 2, 3, "4 px"]},
    ],
)
def test_broken_annotations_are_refused_with_their_place(annotation: dict[str, Any]) -> None:
    error = refusal(document({"segmentation": [LEFT]}, annotation))
    assert (error.code, error.pointer) == ("broken-annotations", "annotations[1]")
    assert "annotations[1]" in str(error)


@pytest.mark.parametrize("ring", [[], [5, 6], [5, 6, 50, 30]])
def test_a_polygon_without_area_is_dropped_with_a_warning(ring: list[float]) -> None:
    found = partition(
        read_coco(encoded(document({"segmentation": [LEFT]}, {"segmentation": [ring]}))), 60, 40
    )
    assert found.warnings == ("1 shape dropped: too small to cover a pixel's centre (annotations[1])",)


@pytest.mark.parametrize("far", [1e8, 1e9, 1e300])
def test_what_lies_far_outside_is_dropped_with_a_warning(far: float) -> None:
    ring = [far, 0, far + 60, 0, far, 40]
    for away in ({"segmentation": [ring]}, {"bbox": [-far, 0, 9, 9]}):
        found = partition(read_coco(encoded(document({"segmentation": [LEFT]}, away))), 60, 40)
        assert found.warnings == ("1 shape dropped: outside the picture (annotations[1])",)


def test_sizes_may_be_whole_floats() -> None:
    value = document({"segmentation": [LEFT]}, {"segmentation": {"size": [40.0, 60.0], "counts": [0, 2400]}})
    value["images"][0].update(width=60.0, height=40.0)
    annotations = read_coco(encoded(value))
    assert (annotations.width, annotations.height) == (60, 40)
    assert annotations.shapes[1].mask is not None


@pytest.mark.parametrize("width", [60.5, "60", None, -60, 1e9, 16_385])
def test_a_size_that_is_none_is_refused_with_its_place(width: object) -> None:
    value = document({"segmentation": [LEFT]})
    value["images"].append({"id": 8, "file_name": "b.png", "width": width, "height": 40})
    data = encoded(value)
    assert read_coco(data, image_name="a.png").width == 60
    with pytest.raises(InputError, match="is not a width or height of 0 to 16384 pixels") as refused:
        read_coco(data, image_name="b.png")
    assert refused.value.pointer == "images[1]"


@pytest.mark.parametrize("constant", [b"NaN", b"Infinity", b"-Infinity", b"1e999"])
def test_numbers_must_be_finite(constant: bytes) -> None:
    data = encoded(document({"segmentation": [LEFT]})).replace(b"20", constant, 1)
    assert refusal(data).code == "broken-annotations"


@pytest.mark.parametrize(
    "data", [b"{", b"{'images': []}", b"[" * 100_000, b'{"images": [' + b"1" * 5000 + b"]}"]
)
def test_broken_json_is_refused(data: bytes) -> None:
    assert refusal(data).code == "broken-annotations"


def test_other_json_is_named_unsupported() -> None:
    assert refusal({"version": "5.0.1", "shapes": []}).code == "unsupported-annotations"
    assert refusal([1, 2]).code == "unsupported-annotations"


@pytest.mark.parametrize("key", ["images", "annotations", "categories"])
def test_lists_must_hold_objects(key: str) -> None:
    values: list[object] = [{}, [1], None, "x"]
    for value in values:
        assert refusal({**document(), key: value}).code == "broken-annotations"


@pytest.mark.parametrize("width", ["60", -1, 1.5, 16385, 10**30, True])
def test_a_size_must_be_one(width: object) -> None:
    assert refusal(document(width=width)).code == "broken-annotations"


@pytest.mark.parametrize(
    ("limits", "segmentation", "fits"),
    [
        ({"max_polygons": 2}, [LEFT], 2),
        ({"max_vertices_per_polygon": 3}, [LEFT], 0),
        ({"max_vertices": 16}, [LEFT, RIGHT], 2),
        ({"mask_pixels": 40}, {"size": [40, 60], "counts": [40, 20, 2340]}, 2),
    ],
)
def test_limits_are_exact(limits: dict[str, int], segmentation: object, fits: int) -> None:
    bound = replace(DEFAULT_LIMITS, **limits)
    annotation = {"segmentation": segmentation}
    assert len(read_coco(encoded(document(*[annotation] * fits)), limits=bound).shapes) == fits
    with pytest.raises(InputError) as error:
        read_coco(encoded(document(*[annotation] * (fits + 1))), limits=bound)
    assert error.value.code == "annotations-too-large"


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.sampled_from(["size", "counts"]), inner),
    max_leaves=12,
)


@given(json_values, json_values, json_values)
def test_any_annotation_makes_finite_shapes_or_a_refusal(
    segmentation: object, bbox: object, category: object
) -> None:
    value = document({"segmentation": segmentation, "bbox": bbox, "category_id": category})
    found = read_or_refused(lambda: read_coco(encoded(value)))
    if isinstance(found, InputError):
        assert found.code == "broken-annotations"
        return
    for shape in found.shapes:
        assert all(np.isfinite(ring).all() for ring in shape.rings)


@given(json_values, st.sampled_from(["images", "annotations", "categories"]))
def test_any_document_reads_or_is_refused(part: object, key: str) -> None:
    for value in (part, {**document(), key: part}, {**document(), key: [part]}):
        found = read_or_refused(partial(read_coco, encoded(value)))
        assert not isinstance(found, InputError) or found.code


@pytest.mark.parametrize("seven", ["7", 7.0])
def test_ids_may_be_numbers_here_and_text_or_floats_there(seven: object) -> None:
    value = document({"segmentation": [LEFT], "image_id": seven})
    assert len(read_coco(encoded(value)).shapes) == 1
    value["images"][0]["id"] = seven
    assert len(read_coco(encoded(value)).shapes) == 1
    value = document({"segmentation": [LEFT], "category_id": 1.0})
    assert read_coco(encoded(value)).shapes[0].label == "sky"


def test_what_has_no_name_gets_none() -> None:
    value = document({"segmentation": [LEFT], "category_id": None}, {"segmentation": [RIGHT]}, file_name=None)
    value["categories"][0]["name"] = None
    assert [shape.label for shape in read_coco(encoded(value)).shapes] == ["", "1"]
