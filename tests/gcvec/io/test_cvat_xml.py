from __future__ import annotations

import tracemalloc
from dataclasses import replace
from typing import Any, NoReturn
from xml.parsers import expat
from xml.sax import SAXParseException
from xml.sax.saxutils import quoteattr
from xml.sax.xmlreader import Locator

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gcvec.errors import InputError
from gcvec.io import DEFAULT_LIMITS
from gcvec.regions.partition import partition
from tests.gcvec.io.single_documents import read_cvat_xml, read_or_refused


def document(*elements: str, name: str = "a.png", size: tuple[int, int] = (60, 40)) -> bytes:
    body = "\n".join(elements)
    return f"""<?xml version="1.0" encoding="utf-8"?>
<annotations>
<version>1.1</version>
<meta><task><labels><label><name>not a shape</name></label></labels></task></meta>
<image id="0" name={quoteattr(name)} width="{size[0]}" height="{size[1]}">
{body}
</image>
</annotations>""".encode()


def refusal(data: bytes) -> InputError:
    with pytest.raises(InputError) as error:
        read_cvat_xml(data)
    assert "\n" not in str(error.value)
    return error.value


def painted(*elements: str) -> NDArray[np.bool_]:
    """Where the first region is, `(40, 60) bool`."""
    result = partition(read_cvat_xml(document(*elements)), 60, 40)
    return np.equal(result.labels, result.names.index("it"))


def test_polygons_keep_label_order_z_and_line() -> None:
    annotations = read_cvat_xml(
        document(
            '<polygon label="sky &amp; sea" points="0,0;60.50,0.00;60,20" z_order="2" occluded="0"/>',
            '<polygon label="" points="1,2;3,4;5,6"></polygon>',
            name="a & b.png",
        )
    )
    sky, other = annotations.shapes
    assert (annotations.width, annotations.height, annotations.warnings) == (60, 40, ())
    assert (sky.label, sky.z_order, sky.pointer) == ("sky & sea", 2, "polygon 1, line 6")
    assert (other.label, other.z_order, other.pointer) == ("", 0, "polygon 2, line 7")
    assert sky.rings[0].tolist() == [[0, 0], [60.5, 0], [60, 20]]


@pytest.mark.parametrize("points", ['points=""', 'points=" ; "', 'points="5,6"', 'points="5,6;50,30"'])
def test_a_polygon_without_area_is_dropped_with_a_warning(points: str) -> None:
    good = '<polygon label="it" points="0,0;60,0;60,20"/>'
    found = partition(read_cvat_xml(document(good, f'<polygon label="none" {points}/>')), 60, 40)
    assert found.warnings == ("1 shape dropped: too small to cover a pixel's centre (polygon 2, line 7)",)


@pytest.mark.parametrize("far", [1e8, 1e12, 1e99])
@pytest.mark.parametrize(
    "shape",
    [
        'polygon points="0,0;{0:f},{1:f};0,20"',
        'polygon points="0,20.25;0,0;{0:f},{1:f};{0:f},{0:f}"',
        'polygon points="9,0;-{1:f},-{0:f};-{0:f},-{1:f};0,20;20,20"',
        'box xtl="-{0:f}" ytl="10" xbr="{0:f}" ybr="20"',
    ],
)
def test_a_shape_that_reaches_far_outside_covers_what_it_encloses(shape: str, far: float) -> None:
    near, inside = (painted(f'<{shape.format(x, x / 2)} label="it"/>') for x in (1e6, far))
    assert 0.1 < near.mean() < 0.9
    assert np.array_equal(inside, near)


@pytest.mark.parametrize("far", [1e8, 1e300])
@pytest.mark.parametrize(
    "shape",
    [
        'polygon points="{0},0;{0},1e99;-5,{0}"',
        'polygon points="-{0},-{0};-1,-{0};-1,{0}"',
        'box xtl="{0}" ytl="0" xbr="{0}" ybr="9"',
        'ellipse cx="-{0}" cy="0" rx="9" ry="5" rotation="30"',
    ],
)
def test_what_lies_far_outside_is_dropped_with_a_warning(shape: str, far: float) -> None:
    good = '<polygon label="it" points="0,0;60,0;60,20"/>'
    found = partition(read_cvat_xml(document(good, f"<{shape.format(far)}/>")), 60, 40)
    assert found.warnings == (f"1 shape dropped: outside the picture ({shape.split()[0]} 2, line 7)",)


def test_boxes_turn_clockwise_about_their_centre() -> None:
    plain = painted('<box label="it" xtl="10" ytl="10" xbr="30" ybr="20"/>')
    assert plain[10:20, 10:30].all()
    assert plain.sum() == 200
    turned = painted('<box label="it" xtl="10" ytl="10" xbr="30" ybr="20" rotation="90.0"/>')
    assert turned[5:25, 15:25].all()
    assert turned.sum() == 200
    (shape,) = read_cvat_xml(
        document('<box label="it" xtl="0" ytl="0" xbr="20" ybr="0" rotation="30"/>')
    ).shapes
    tip = shape.rings[0][1]  # the right end dips down on the screen
    np.testing.assert_allclose(tip, (10 + 10 * np.cos(np.pi / 6), 5.0))


def test_ellipses_cover_what_their_equation_says() -> None:
    inside = painted('<ellipse label="it" cx="30.5" cy="19.5" rx="16" ry="7" rotation="25"/>')
    x, y = np.arange(60) + 0.5 - 30.5, (np.arange(40) + 0.5 - 19.5)[:, None]
    turn = np.deg2rad(25)
    along, across = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    np.testing.assert_array_equal(inside, (along / 16) ** 2 + (across / 7) ** 2 <= 1)


def test_masks_are_rows_of_a_cropped_box_starting_with_background() -> None:
    inside = painted('<mask label="it" left="20" top="10" width="8" height="4" rle="4, 4, 0, 16, 4, 4"/>')
    expected = np.zeros((40, 60), dtype=bool)
    expected[10:14, 20:28] = True
    expected[10, 20:24] = False
    expected[13, 20:24] = False
    np.testing.assert_array_equal(inside, expected)


@pytest.mark.parametrize(
    "box",
    [
        'left="0" top="0" width="60" height="40"',
        'width="60" height="40"',
        'left="0" top="0"',
        'top="0" width="60"',
        "",
    ],
)
def test_a_mask_of_the_whole_image_need_not_say_where_it_lies(box: str) -> None:
    inside = painted(f'<mask label="it" {box} rle="1205, 20, 1175"/>')
    assert inside.sum() == 20
    assert inside[20, 5:25].all()


@pytest.mark.parametrize(
    ("box", "missing"),
    [
        ('width="8" height="4"', "left"),
        ('left="20" width="8" height="4"', "top"),
        ('left="20" top="10" height="4"', "width"),
        ('left="1" top="0"', "width"),
        ('width="60" height="39"', "left"),
    ],
)
def test_a_mask_of_a_part_of_the_image_must_say_where_it_lies(box: str, missing: str) -> None:
    error = refusal(document(f'<mask label="it" {box} rle="0, 32"/>'))
    assert str(error) == f"mask 1, line 6: {missing!r} is missing, and the mask is not of the whole image"


@pytest.mark.parametrize(("stated", "missing"), [("width", "height"), ("height", "width")])
def test_a_mask_cannot_have_a_side_that_nothing_states(stated: str, missing: str) -> None:
    image = f'<image name="a.png" {stated}="10"><mask label="it" rle="0, 100"/></image>'
    wanted = f"mask 1, line 1: {missing!r} is missing, and the image does not state it either"
    assert str(refusal(f"<annotations>{image}</annotations>".encode())) == wanted


def test_a_mask_without_a_place_in_an_image_without_a_size_is_refused() -> None:
    image = '<annotations><image name="a.png"><mask label="it" rle="0, 32" {}/></image></annotations>'
    for box in ("", 'width="8" height="4"', 'left="0" top="0"'):
        assert refusal(image.format(box).encode()).code == "broken-annotations"


def test_what_encloses_no_region_is_left_out_with_a_warning() -> None:
    annotations = read_cvat_xml(
        document(
            '<polyline label="l" points="1,2;3,4"/>',
            '<points label="p" points="1,2"/>',
            '<skeleton label="s"><points label="1" points="1,1"/><points label="2" points="2,2"/></skeleton>',
            '<cuboid label="c" xtl1="1"/>',
            '<tag label="indoors"/>',
            '<box label="it" xtl="0" ytl="0" xbr="9" ybr="9"><attribute name="polygon">x</attribute></box>',
        )
    )
    assert [shape.label for shape in annotations.shapes] == ["it"]
    assert len(annotations.warnings) == 4
    assert "1 <points> left out: encloses no region" in annotations.warnings


def several_images() -> bytes:
    return b"""<annotations>
    <image name="a.png" width="1" height="1" subset="train"/>
    <image name="a.png" width="2" height="2" subset="test"/>
    <image name="b.png" width="3" height="3" subset="test"/>
    </annotations>"""


def test_the_image_is_chosen_by_name_and_by_subset_where_names_repeat() -> None:
    assert read_cvat_xml(several_images(), image_name="b.png").width == 3
    assert read_cvat_xml(several_images(), image_name="test/a.png").width == 2
    with pytest.raises(InputError, match=r"'train/a.png', 'test/a.png'"):
        read_cvat_xml(several_images(), image_name="a.png")


def images_of_tasks() -> bytes:
    return b"""<annotations><meta><project><name>photos</name><tasks>
    <task><id>7</id><name>morning &amp; noon</name><labels><label><name>sky</name></label></labels></task>
    <task><id>8</id><name>evening</name></task></tasks></project></meta>
    <image name="a.png" width="1" height="1" subset="train" task_id="7"/>
    <image name="a.png" width="2" height="2" subset="train" task_id="8"/>
    <image name="a.png" width="3" height="3" subset="test" task_id="8"/>
    <image name="sub/b.png" width="4" height="4" task_id="7"/>
    <image name="sub/b.png" width="5" height="5" task_id="8"/>
    <image name="c.png" width="6" height="6" task_id="9"/>
    </annotations>"""


@pytest.mark.parametrize(
    ("name", "width"),
    [
        ("morning & noon/a.png", 1),
        ("train/evening/a.png", 2),
        ("/exports/test/a.png", 3),
        ("test/evening/a.png", 3),
        ("morning & noon/sub/b.jpg", 4),
        ("/exports/evening/sub/b.png", 5),
        ("c.png", 6),
    ],
)
def test_the_image_is_chosen_by_task_where_names_repeat(name: str, width: int) -> None:
    assert read_cvat_xml(images_of_tasks(), image_name=name).width == width
    assert read_cvat_xml(images_of_tasks(), picture_name=name).width == width


def test_images_of_one_name_are_listed_with_what_tells_them_apart() -> None:
    for name, listed in (
        ("a.png", r"'morning & noon/a.png', 'train/evening/a.png', 'test/a.png'"),
        ("evening/a.png", r"'train/evening/a.png', 'test/a.png'"),
        ("b.png", r"'morning & noon/sub/b.png', 'evening/sub/b.png'"),
    ):
        with pytest.raises(InputError, match=rf"several images match .*{listed}"):
            read_cvat_xml(images_of_tasks(), image_name=name)


def test_a_task_of_another_subset_is_not_the_one_of_an_image() -> None:
    data = b"""<annotations><meta><project><tasks>
    <task><id>7</id><name>test</name><subset>test</subset></task></tasks></project></meta>
    <image name="a.png" width="1" height="1" subset="test" task_id="7"/>
    <image name="a.png" width="2" height="2" subset="train" task_id="7"/>
    </annotations>"""
    assert read_cvat_xml(data, picture_name="/exports/test/a.png").width == 1
    with pytest.raises(InputError, match=r"'test/a.png', 'train/a.png'"):
        read_cvat_xml(data, image_name="a.png")


def test_only_the_chosen_image_is_read() -> None:
    data = document('<polygon points="nonsense"/>').replace(
        b"</annotations>", b'<image name="b.png" width="3" height="3"/></annotations>'
    )
    assert read_cvat_xml(data, image_name="b.png").shapes == ()


@pytest.mark.parametrize(
    "element",
    [
        '<polygon label="x"/>',
        '<polygon points="1,2;3"/>',
        '<polygon points="1,2;3,4,5"/>',
        '<polygon points="1,2;3,four"/>',
        '<polygon points="1,2;3,nan;5,6"/>',
        '<polygon points="1,2;3,1_0;5,6"/>',
        '<polygon points="1,2;3,\u0664;5,6"/>',
        '<polygon points="1,2;3,4;5,6" z_order="\u0661"/>',
        '<box xtl="1" ytl="1" xbr="\u0669" ybr="5"/>',
        '<polygon points="1,2;3,inf;5,6"/>',
        '<polygon points="1,2;3,1e400;5,6"/>',
        '<polygon points="1,2;3,4;5,6" z_order="top"/>',
        '<box xtl="1" ytl="1" xbr="5"/>',
        '<box xtl="1" ytl="1" xbr="5" ybr="nan"/>',
        '<box xtl="1" ytl="1" xbr="5" ybr="5" rotation="infinity"/>',
        '<ellipse cx="1" cy="1" rx="1"/>',
        '<ellipse cx="1" cy="1" rx="nan" ry="1"/>',
        '<mask left="0" top="0" width="2" height="2"/>',
        '<mask left="0" top="0" width="2" height="2" rle="1, 2"/>',
        '<mask left="0" top="0" width="2" height="2" rle="1, 4"/>',
        '<mask left="0" top="0" width="2" height="2" rle="5, -1"/>',
        '<mask left="0" top="0" width="2" height="2" rle="4.0"/>',
        '<mask left="0" top="0" width="2" height="2" rle="\u0664"/>',
        '<mask left="0" top="0" width="1_0" height="2" rle="20"/>',
        '<mask left="0" top="0" width="0" height="2" rle="0"/>',
        '<mask left="0" top="0" width="-2" height="-2" rle="4"/>',
        '<mask left="0" top="0" width="2" height="2" rle="99999999999999999999"/>',
    ],
)
def test_broken_shapes_are_refused_with_their_line(element: str) -> None:
    error = refusal(document(element))
    assert error.code == "broken-annotations"
    assert error.pointer is not None
    assert error.pointer.endswith("1, line 6")
    assert error.pointer in str(error)


def test_what_python_alone_takes_for_a_number_is_named() -> None:
    assert str(refusal(document('<polygon points="1,2;3,1_0;5,6"/>'))).endswith("are not numbers: '1_0'")
    assert "width='\u0663'" in str(refusal(document().replace(b'"60"', '"\u0663"'.encode())))


def test_broken_xml_is_refused_with_its_line() -> None:
    error = refusal(document("<polygon>"))
    assert (error.code, error.pointer) == ("broken-annotations", "line 7")
    assert refusal(b"<annotations>").code == "broken-annotations"
    assert refusal(document('<image width="wide"/>').replace(b'"60"', b'"wide"')).pointer is not None


@pytest.mark.parametrize(
    "head",
    [
        '<!DOCTYPE lolz [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        '<!DOCTYPE x SYSTEM "file:///etc/passwd">',
        '<!DOCTYPE x [<!ENTITY e SYSTEM "http://127.0.0.1:9/">]>',
        "<!DOCTYPE annotations>",
    ],
)
def test_document_types_and_entities_are_refused(head: str) -> None:
    assert refusal(f"{head}<annotations/>".encode()).code == "unsafe-annotations"


def test_other_xml_is_named_unsupported() -> None:
    assert refusal(b"<annotation><folder/></annotation>").code == "unsupported-annotations"
    error = refusal(b'<annotations><track id="0"/></annotations>')
    assert error.code == "unsupported-annotations"
    assert "CVAT for images" in str(error)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_encodings_are_recognised(encoding: str) -> None:
    text = '<annotations><image name="é.png" width="3" height="4"/></annotations>'
    assert read_cvat_xml(text.encode(encoding), image_name="é.png").height == 4


@pytest.mark.parametrize("encoding", ["klingon", "utf-7", "hex"])
def test_an_unusable_encoding_is_refused(encoding: str) -> None:
    data = f'<?xml version="1.0" encoding="{encoding}"?><annotations/>'.encode()
    assert refusal(data).code == "broken-annotations"


TRIANGLE = '<polygon label="t" points="0,0;9,0;9,9"/>'
DISC = '<ellipse label="e" cx="9" cy="9" rx="4" ry="3"/>'
BOX = '<box label="b" xtl="1" ytl="1" xbr="9" ybr="9"/>'
MASK = '<mask label="m" left="0" top="0" width="4" height="4" rle="0, 16"/>'


@pytest.mark.parametrize(
    ("limits", "elements", "fits"),
    [
        ({"max_polygons": 2}, (TRIANGLE,), 2),
        ({"max_vertices_per_polygon": 2}, (TRIANGLE,), 0),
        ({"max_vertices": 9}, (TRIANGLE,), 3),
        ({"max_vertices": 100}, (DISC,), 2),
        ({"max_vertices": 12}, (BOX,), 3),
        ({"mask_pixels": 32}, (MASK,), 2),
    ],
)
def test_limits_are_exact(limits: dict[str, int], elements: tuple[str], fits: int) -> None:
    bound = replace(DEFAULT_LIMITS, **limits)
    assert len(read_cvat_xml(document(*elements * fits), limits=bound).shapes) == fits
    with pytest.raises(InputError) as error:
        read_cvat_xml(document(*elements * (fits + 1)), limits=bound)
    assert error.value.code == "annotations-too-large"
    assert error.value.pointer is not None


def test_a_huge_ellipse_is_refused_before_it_is_made() -> None:
    tracemalloc.start()
    try:
        element = '<ellipse label="e" cx="0" cy="0" rx="9999999" ry="9999999"/>'
        assert refusal(document(element)).code == "annotations-too-large"
        assert tracemalloc.get_traced_memory()[1] < 2**19
    finally:
        tracemalloc.stop()


def test_a_huge_mask_is_refused_before_it_is_made() -> None:
    element = '<mask label="m" left="0" top="0" width="99999999" height="99999999" rle="9999999800000001"/>'
    assert refusal(document(element)).code == "annotations-too-large"


numbers = st.one_of(st.integers(-5, 70).map(str), st.floats().map(str), st.text(max_size=3))
attributes = st.dictionaries(
    st.sampled_from(
        [
            "label",
            "points",
            "z_order",
            "rotation",
            "xtl",
            "ytl",
            "xbr",
            "ybr",
            "cx",
            "cy",
            "rx",
            "ry",
            "left",
            "top",
            "width",
            "height",
            "rle",
        ]
    ),
    st.one_of(
        numbers,
        st.lists(st.tuples(numbers, numbers).map(",".join), max_size=5).map(";".join),
        st.lists(numbers, max_size=6).map(", ".join),
    ),
)


@given(
    st.lists(
        st.tuples(st.sampled_from(["polygon", "box", "ellipse", "mask", "points", "image"]), attributes),
        max_size=4,
    )
)
def test_any_attributes_make_finite_shapes_or_a_refusal(elements: list[tuple[str, dict[str, str]]]) -> None:
    tags = [
        f"<{tag} {' '.join(f'{key}={quoteattr(value)}' for key, value in values.items())}/>"
        for tag, values in elements
    ]
    assert_finite_or_refused(document(*tags))


@given(st.data())
def test_a_document_with_flipped_bytes_reads_or_is_refused(data: st.DataObject) -> None:
    file = bytearray(document(TRIANGLE, MASK))
    for _ in range(data.draw(st.integers(1, 5))):
        file[data.draw(st.integers(0, len(file) - 1))] = data.draw(st.integers(0, 255))
    assert_finite_or_refused(bytes(file))


def assert_finite_or_refused(data: bytes) -> None:
    limits = replace(DEFAULT_LIMITS, mask_pixels=10_000)
    found = read_or_refused(lambda: read_cvat_xml(data, limits=limits))
    if isinstance(found, InputError):
        assert found.code
        return
    for shape in found.shapes:
        assert (shape.mask is None) == bool(shape.rings)
        assert all(np.isfinite(ring).all() and ring.shape[1] == 2 for ring in shape.rings)


def test_a_lack_of_memory_is_no_fault_of_the_file(monkeypatch: pytest.MonkeyPatch) -> None:
    """The parser's own allocations fail with a status, not with Python's exception."""

    def fail(*_: Any, **__: Any) -> NoReturn:
        raise SAXParseException(expat.ErrorString(1), None, Locator())

    assert expat.errors.codes[expat.errors.XML_ERROR_NO_MEMORY] == 1
    monkeypatch.setattr("defusedxml.sax.parseString", fail)
    with pytest.raises(MemoryError):
        read_cvat_xml(document())
