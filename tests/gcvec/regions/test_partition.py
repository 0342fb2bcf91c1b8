from __future__ import annotations

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gcvec.annotations import Annotations, Shape
from gcvec.errors import InputError
from gcvec.regions.components import connected_components
from gcvec.regions.partition import partition


def box(left: float, top: float, right: float, bottom: float, label: str = "box", z: int = 0) -> Shape:
    ring = np.array([(left, top), (right, top), (right, bottom), (left, bottom)], dtype=float)
    return Shape(label, rings=(ring,), z_order=z)


def disc(x: float, y: float, radius: float, label: str = "disc") -> Shape:
    angle = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    return Shape(label, rings=(np.column_stack([x + radius * np.cos(angle), y + radius * np.sin(angle)]),))


def regions(*shapes: Shape, size: tuple[int, int] = (60, 40)) -> tuple[NDArray[np.int32], tuple[str, ...]]:
    result = partition(Annotations(shapes), *size)
    assert result.labels.shape == size[::-1]
    assert result.labels.dtype == np.int32
    assert result.labels.max() + 1 == len(result.names)
    np.testing.assert_array_equal(
        connected_components(result.labels), result.labels
    )  # connected, raster order
    return result.labels, result.names


def warnings_of(*shapes: Shape, size: tuple[int, int] = (60, 40)) -> tuple[str, ...]:
    return partition(Annotations(shapes), *size).warnings


def test_an_object_on_a_background_makes_a_ring() -> None:
    labels, names = regions(disc(30, 20, 12))
    assert names == ("background", "disc")
    inside = np.hypot(np.arange(60) + 0.5 - 30, (np.arange(40) + 0.5 - 20)[:, None]) < 11.9
    assert (labels[inside] == 1).all()


def test_regions_within_regions_within_regions() -> None:
    labels, names = regions(disc(30, 20, 14, "a"), disc(30, 20, 9, "b"), disc(30, 20, 4, "c"))
    assert names == ("background", "a", "b", "c")
    assert [labels[20, x] for x in (5, 18, 24, 30)] == [0, 1, 2, 3]


def test_z_order_decides_and_later_shapes_win_ties() -> None:
    low, high = box(0, 0, 60, 40, "low", z=-1), box(0, 0, 30, 40, "high", z=5)
    assert regions(high, low)[1] == ("high", "low")
    labels, names = regions(box(0, 0, 60, 40, "first"), box(0, 0, 30, 40, "second"))
    assert names == ("second", "first")
    assert (labels[:, :30] == 0).all()


def test_neighbours_with_a_gap_meet_and_with_an_overlap_the_upper_wins() -> None:
    labels, _ = regions(box(0, 0, 29, 40), box(31, 0, 60, 40))
    assert (labels[:, :30] == 0).all()
    assert (labels[:, 30:] == 1).all()
    labels, _ = regions(box(0, 0, 32, 40, "under"), box(29, 0, 60, 40, "over"))
    assert (labels[:, :29] == 0).all()
    assert (labels[:, 29:] == 1).all()


def test_parts_that_do_not_touch_are_regions_of_their_own() -> None:
    rings = box(0, 0, 10, 40).rings + box(40, 0, 60, 40).rings
    _, names = regions(Shape("pair", rings=rings))
    assert names == ("pair", "background", "pair")


def test_rings_of_one_shape_are_a_union_whatever_their_direction() -> None:
    rings = (box(0, 0, 40, 40).rings[0], box(20, 0, 60, 40).rings[0][::-1])
    labels, names = regions(Shape("both", rings=rings))
    assert names == ("both",)
    assert not labels.any()


def test_diagonal_contact_is_not_connection() -> None:
    _, names = regions(box(0, 0, 30, 20, "a"), box(30, 20, 60, 40, "a"))
    assert names == ("a", "background", "background", "a")


def stroke(width: float, slope: float, label: str = "stroke", z: int = 0) -> Shape:
    """A line across most of the picture."""
    along = np.array([1, slope]) / np.hypot(1, slope)
    across = np.array([-along[1], along[0]]) * width / 2
    start, end = np.array([8.3, 20 - 22 * slope]), np.array([52.1, 20 + 22 * slope])
    return Shape(
        label, rings=(np.array([start + across, end + across, end - across, start - across]),), z_order=z
    )


@pytest.mark.parametrize("width", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("slope", [-0.8, -0.5, 0.0, 0.3, 0.45, 0.7])
def test_a_thin_line_is_one_region(width: float, slope: float) -> None:
    labels, names = regions(stroke(width, slope))
    own = [k for k, name in enumerate(names) if name == "stroke"]
    assert len(own) == 1
    x = np.nonzero(labels == own[0])[1]
    assert x.min() <= 9
    assert x.max() >= 50


def test_what_lies_above_is_not_cut_by_lines_below() -> None:
    """Two thin lines that cross: the upper one goes through."""
    for up, down in ((0.7, -0.6), (-0.6, 0.7)):
        _, names = regions(stroke(1.2, up, "upper", 1), stroke(1.2, down, "lower", 0))
        assert names.count("upper") == 1
        assert names.count("lower") == 2


def test_masks_paint_like_polygons_and_may_leave_the_picture() -> None:
    mask = np.ones((20, 30), dtype=bool)
    mask[:, :10] = False
    labels, names = regions(Shape("m", mask=mask, offset=(-10, -5)))
    assert names == ("m", "background")
    assert np.array_equal(labels == 0, np.pad(np.ones((15, 20), dtype=bool), ((0, 25), (0, 40))))


def test_slivers_join_the_longest_border() -> None:
    labels, names = regions(box(0, 0, 60, 20, "up"), box(0, 20, 60, 40, "down"), box(10, 17, 13, 20, "tiny"))
    assert names == ("up", "down")
    assert labels[18, 11] == 0


def test_one_pixel_one_region() -> None:
    labels, names = regions(box(0, 0, 1, 1, "dot"), size=(1, 1))
    assert labels.tolist() == [[0]]
    assert names == ("dot",)


def test_a_thousand_regions() -> None:
    tiles = [box(x * 5, y * 5, x * 5 + 5, y * 5 + 5, f"{x},{y}") for y in range(25) for x in range(40)]
    labels, names = regions(*tiles, size=(200, 125))
    assert names == tuple(tile.label for tile in tiles)
    assert (np.bincount(labels.ravel()) == 25).all()


@pytest.mark.parametrize(
    ("shape", "warning"),
    [
        (box(70, 0, 90, 10), "outside the picture"),
        (box(5.6, 5.6, 6.4, 6.4), "too small"),
        (Shape("line", rings=(np.array([(1.0, 1.0), (9.0, 9.0)]),)), "too small"),
        (Shape("nothing"), "too small"),
        (Shape("nothing", mask=np.zeros((0, 0), dtype=bool)), "its mask is empty"),
        (Shape("nothing", mask=np.zeros((2, 2), dtype=bool), offset=(60, 0)), "its mask is empty"),
        (Shape("far", mask=np.ones((2, 2), dtype=bool), offset=(60, 0)), "outside the picture"),
        (box(5, 5, 8, 8), "under 16 px²"),
    ],
)
def test_useless_shapes_are_dropped_with_a_warning(shape: Shape, warning: str) -> None:
    warnings = warnings_of(box(0, 0, 60, 40), shape)
    assert len(warnings) == 1
    assert warning in warnings[0]
    assert "shape 2" in warnings[0]


def test_duplicates_and_hidden_shapes_are_dropped_with_a_warning() -> None:
    assert warnings_of(box(0, 0, 30, 40, "a"), box(0, 0, 30, 40, "b")) == (
        "1 shape dropped: another has the same outline (shape 1)",
    )
    assert warnings_of(box(5, 5, 20, 20), box(0, 0, 30, 40)) == (
        "1 shape dropped: hidden under others (shape 1)",
    )


def test_pointers_name_the_shape_and_long_lists_are_cut() -> None:
    outside = [
        Shape("o", rings=box(70 + i, 0, 90, 10).rings, pointer=f"polygon {i}, line {i}") for i in range(8)
    ]
    (warning,) = warnings_of(box(0, 0, 60, 40), *outside)
    assert warning.startswith("8 shapes dropped: outside the picture (polygon 0, line 0; polygon 1, line 1;")
    assert warning.endswith("; …)")


def test_warnings_of_the_reader_come_first() -> None:
    result = partition(Annotations((box(0, 0, 60, 40),), warnings=("read",)), 60, 40)
    assert result.warnings == ("read",)


def test_a_scribble_of_400_vertices_is_filled_like_a_disc_and_reported() -> None:
    """Tens of thousands of crossings cost little; to resolve them would take a thousand times as long."""
    angle = np.linspace(0, 2 * np.pi, 400, endpoint=False)
    disc = 500 + 400 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    scribble = np.random.default_rng(5).uniform(0, 1000, (400, 2))

    def alone(points: np.ndarray) -> Annotations:
        return Annotations((Shape("it", rings=(points,)),))

    def seconds(points: np.ndarray) -> float:
        start = time.process_time()
        partition(alone(points), 1000, 1000)
        return time.process_time() - start

    plain, crossing = (min(seconds(points) for _ in range(3)) for points in (disc, scribble))
    assert crossing < 20 * plain
    assert "crossing itself" in partition(alone(scribble), 1000, 1000).warnings[0]


def test_no_shape_in_the_picture_is_an_error() -> None:
    with pytest.raises(InputError) as error:
        partition(Annotations((box(70, 0, 90, 10),)), 60, 40)
    assert error.value.code == "no-usable-polygon"


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_coordinates_must_be_finite(value: float) -> None:
    with pytest.raises(InputError) as error:
        partition(Annotations((box(0, 0, value, 9),)), 60, 40)
    assert error.value.code == "broken-annotations"


@pytest.mark.parametrize(
    ("shape", "cause"),
    [
        (Shape("x", mask=np.eye(9, dtype=np.uint8), pointer="shape 7"), "a mask must be"),
        (Shape("x", mask=np.ones(9, bool), pointer="shape 7"), "a mask must be"),
        (Shape("x", rings=([[0, 0], [9, 0], [9, 9]],), pointer="shape 7"), "a ring must be"),
        (Shape("x", rings=(np.zeros((3, 3)),), pointer="shape 7"), "a ring must be"),
        (Shape("x", rings=(np.zeros((3, 2), complex),), pointer="shape 7"), "a ring must be"),
    ],
    ids=["mask-of-numbers", "mask-of-one-row", "list", "triples", "complex"],
)
def test_outlines_of_another_kind_are_refused(shape: Shape, cause: str) -> None:
    """Numbers would be taken for places in the picture, and paint others than are meant."""
    with pytest.raises(InputError, match=cause) as error:
        partition(Annotations((box(0, 0, 9, 9), shape)), 60, 40)
    assert (error.value.code, error.value.pointer) == ("broken-annotations", "shape 7")


coordinates = st.floats(-20, 80, allow_nan=False)
shapes = st.lists(
    st.builds(
        lambda points, z: Shape("s", rings=(np.array(points, dtype=float),), z_order=z),
        st.lists(st.tuples(coordinates, coordinates), min_size=1, max_size=8),
        st.integers(-1, 1),
    ),
    min_size=1,
    max_size=6,
)


@given(shapes, st.integers(1, 50), st.integers(1, 50))
def test_any_shapes_make_connected_regions_of_16_pixels(drawn: list[Shape], width: int, height: int) -> None:
    picture = box(0, 0, width, height, z=-2)  # so that some shape covers a pixel
    labels, _ = regions(picture, *drawn, size=(width, height))
    areas = np.bincount(labels.ravel())
    assert len(areas) == 1 or areas.min() >= 16


@given(shapes)
def test_what_no_shape_covers_is_background(drawn: list[Shape]) -> None:
    labels, names = regions(box(0, 0, 10, 10, "seed"), *drawn, size=(100, 100))
    background = np.array([name == "background" for name in names])[labels]
    assert background[90:, 90:].all()


def test_shapes_of_which_next_to_nothing_is_seen_are_no_regions() -> None:
    with pytest.raises(InputError, match="16 px") as refused:
        partition(Annotations((box(20, 14, 22, 16),)), 40, 30)
    assert refused.value.code == "no-usable-polygon"
