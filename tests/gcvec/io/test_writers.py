from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import skimage.data
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy.ndimage import binary_fill_holes

from gcvec.errors import InputError
from gcvec.io import DEFAULT_LIMITS, Limits, check_size, read_annotations, write_coco, write_cvat_xml
from gcvec.io.long_outlines import to_be_masked
from gcvec.io.outlines import Outline, outlines
from gcvec.regions.components import absorb_slivers, connected_components
from gcvec.regions.partition import Partition, partition
from gcvec.regions.polygon_fill import fill_ring
from gcvec.regions.segment import segment

Labels = NDArray[np.int32]
Write = Callable[[Partition, str], bytes]

both_formats = pytest.mark.parametrize("write", [write_cvat_xml, write_coco])


def regions(owners: Labels) -> Partition:
    labels = connected_components(absorb_slivers(owners))
    return Partition(labels, tuple(f"region {i % 3}" for i in range(labels.max() + 1)))


def assert_comes_back(write: Write, written: Partition, name: str = "a.png") -> None:
    height, width = written.labels.shape
    annotations = read_annotations(write(written, name), image_name=name)
    check_size(annotations, width, height)
    read = partition(annotations, width, height)
    np.testing.assert_array_equal(read.labels, written.labels)
    assert read.names == written.names
    assert read.warnings == ()


def assert_comes_back_within(limits: Limits, write: Callable[..., bytes], written: Partition) -> bytes:
    """Read back under the limits that it was written for, the document gives the same label map."""
    document = write(written, "a.png", limits)
    height, width = written.labels.shape
    read = partition(read_annotations(document, limits=limits), width, height)
    np.testing.assert_array_equal(read.labels, written.labels)
    assert (read.names, read.warnings) == (written.names, ())
    return document


def blocks(tiles: Labels) -> Labels:
    return np.kron(tiles, np.ones((4, 4), dtype=np.int32))


nested = blocks(
    np.array(
        [
            [0, 0, 0, 0, 0, 0, 0, 5],
            [0, 1, 1, 1, 1, 1, 0, 5],
            [0, 1, 2, 2, 2, 1, 0, 5],
            [0, 1, 2, 3, 2, 1, 0, 0],
            [0, 1, 2, 2, 2, 1, 0, 0],
            [0, 1, 1, 1, 1, 1, 0, 6],
            [0, 0, 0, 0, 0, 0, 0, 0],
        ],
        dtype=np.int32,
    )
)

# small blocks over a few owners: many regions, holes, and regions that touch themselves at a corner
tiles = hnp.arrays(np.int32, st.tuples(st.integers(1, 9), st.integers(1, 9)), elements=st.integers(0, 2))
pixels = hnp.arrays(np.int32, st.tuples(st.integers(1, 30), st.integers(1, 30)), elements=st.integers(0, 1))


@both_formats
@given(owners=tiles.map(blocks) | pixels)
def test_every_label_map_comes_back(write: Write, owners: Labels) -> None:
    assert_comes_back(write, regions(owners))


@both_formats
def test_the_regions_of_a_photo_come_back(write: Write) -> None:
    assert_comes_back(write, segment(skimage.data.coffee()), "coffee.png")


@both_formats
@pytest.mark.parametrize("name", ["a b.png", 'quo"te & <tag>.png', "é\N{SNOWMAN}.png", "sub/dir/a.png", ""])
def test_names_come_back(write: Write, name: str) -> None:
    labels = np.zeros((2, 3), dtype=np.int32)
    assert_comes_back(write, Partition(labels, (f"label {name}",)), name)


@pytest.mark.parametrize("text", ["\x00\x1b", "\ud800"])
def test_what_xml_cannot_hold_is_replaced(text: str) -> None:
    written = write_cvat_xml(Partition(np.zeros((2, 3), dtype=np.int32), (text,)), text)
    (shape,) = read_annotations(written).shapes
    assert shape.label == "\ufffd" * len(text)


@given(tiles.map(blocks))
def test_an_outline_holds_the_region_and_what_it_surrounds(owners: Labels) -> None:
    labels = regions(owners).labels
    for region, outline in enumerate(outlines(labels)):
        filled = np.zeros_like(labels)
        fill_ring(filled, outline.ring, 1)
        np.testing.assert_array_equal(filled, binary_fill_holes(labels == region, np.ones((3, 3))))


def test_what_touches_the_outside_at_a_corner_is_not_surrounded() -> None:
    ring = blocks(np.array([[1, 1, 1, 0], [1, 2, 1, 0], [1, 1, 0, 0]], dtype=np.int32))
    assert [outline.depth for outline in outlines(connected_components(ring))] == [0, 0, 0]


def test_depth_counts_the_regions_around() -> None:
    found = regions(nested)
    depth = [outline.depth for outline in outlines(found.labels)]
    tile_depth = np.array(depth)[found.labels][::4, ::4]
    assert tile_depth[3].tolist() == [0, 1, 2, 3, 2, 1, 0, 0]
    assert tile_depth[5].tolist() == [0, 1, 1, 1, 1, 1, 0, 0]
    assert tile_depth[:, 7].tolist() == [0] * 7


def test_a_ring_has_only_the_corners() -> None:
    (outline,) = outlines(np.zeros((20, 30), dtype=np.int32))
    assert outline.ring.tolist() == [[0, 0], [30, 0], [30, 20], [0, 20]]


def test_neighbours_have_the_vertices_between_them_in_common() -> None:
    """Every side of a polygon lies on the frame or is a side of another, walked the other way."""
    height, width = 80, 100
    seeds = np.random.default_rng(3).uniform(0, 80, (15, 2))
    centres = np.stack(np.mgrid[:height, :width], axis=-1)
    nearest = np.linalg.norm(centres[:, :, None] - seeds, axis=3).argmin(axis=2)
    rings = [outline.ring for outline in outlines(connected_components(nearest.astype(np.int32)))]
    sides = {(*a, *b) for ring in rings for a, b in pairwise([*ring.tolist(), ring[0].tolist()])}
    for x, y, x1, y1 in sides:
        on_frame = x == x1 in (0, width) or y == y1 in (0, height)
        assert on_frame != ((x1, y1, x, y) in sides)


@pytest.mark.parametrize(
    ("run", "rise"), [(1, 1), (2, 1), (3, 1), (7, 1), (5, 1)], ids=lambda value: str(value)
)
def test_a_staircase_becomes_a_line(run: int, rise: int) -> None:
    y, x = np.mgrid[:60, :60]
    labels = connected_components((x // run * rise >= y).astype(np.int32))
    for outline in outlines(labels):
        assert len(outline.ring) <= 8, outline.ring.tolist()


def test_right_angles_stay() -> None:
    labels = np.zeros((40, 50), np.int32)
    labels[10:25, 15:40] = 1
    _, inner = outlines(labels)
    assert inner.ring.tolist() == [[15, 10], [40, 10], [40, 25], [15, 25]]
    assert inner.box == (15, 10, 40, 25)


def test_a_disc_takes_few_vertices_that_stay_within_half_a_pixel() -> None:
    y, x = np.mgrid[:120, :120]
    inside = np.hypot(x - 60, y - 58) < 40
    _, disc = outlines(inside.astype(np.int32))
    assert 8 < len(disc.ring) < 50
    rows, columns = np.nonzero(np.diff(inside, axis=1))
    stairs = np.column_stack([columns + 1, rows + 0.5])
    along = np.roll(disc.ring, -1, axis=0) - disc.ring
    to_stairs = stairs[:, None] - disc.ring
    share = np.clip((to_stairs * along).sum(2) / (along**2).sum(1), 0, 1)
    distance = np.linalg.norm(to_stairs - share[..., None] * along, axis=2).min(axis=1)
    assert distance.max() <= 0.5


def test_the_regions_of_a_photo_can_be_corrected_by_hand() -> None:
    found = outlines(segment(skimage.data.chelsea()).labels)
    assert sum(len(outline.ring) for outline in found) / len(found) < 75


def test_coco_states_the_area_without_holes_and_the_box() -> None:
    document = json.loads(write_coco(regions(nested), "a.png"))
    outer = document["annotations"][0]
    assert outer["area"] == int((nested == 0).sum())
    assert outer["bbox"] == [0, 0, 32, 28]
    assert document["categories"] == [{"id": i, "name": f"region {i - 1}"} for i in (1, 2, 3)]


def test_cvat_shapes_inside_others_lie_above_them() -> None:
    shapes = read_annotations(write_cvat_xml(regions(nested), "a.png")).shapes
    assert sorted({shape.z_order for shape in shapes}) == [0, 1, 2, 3]


@both_formats
@given(
    owners=tiles.map(blocks) | pixels,
    most=st.sampled_from([(4, 200_000), (8, 30), (20_000, 20), (0, 0)]),
)
def test_outlines_beyond_the_limits_come_back_as_masks(
    write: Callable[..., bytes], owners: Labels, most: tuple[int, int]
) -> None:
    limits = replace(DEFAULT_LIMITS, max_vertices_per_polygon=most[0], max_vertices=most[1])
    assert_comes_back_within(limits, write, regions(owners))


def comb(teeth: int) -> Labels:
    """Three regions, the one between with teeth at both sides that cost it four vertices each."""
    labels = np.zeros((30, 2 * teeth), np.int32)
    labels[10:20] = 1
    labels[20:] = 2
    labels[1:10, 0::4] = labels[1:10, 1::4] = 1
    labels[20:29, 0::4] = labels[20:29, 1::4] = 1
    return labels


@both_formats
def test_an_outline_of_more_than_20000_vertices_is_written_as_a_mask(write: Callable[..., bytes]) -> None:
    for teeth, is_mask in ((4_990, False), (5_010, True)):
        document = assert_comes_back_within(DEFAULT_LIMITS, write, regions(comb(teeth)))
        assert (b"rle=" in document or b'"counts"' in document) == is_mask


def zigzag(vertices: int, side: int) -> Outline:
    """An outline with so many vertices in a square."""
    x = np.arange(vertices) % 2 * side
    y = np.linspace(0, side, vertices).astype(np.int64)
    return Outline(np.column_stack([x, y]).astype(float), (0, 0, side, side), 0)


@pytest.mark.parametrize(
    ("most", "masked"),
    [(94, []), (93, [0]), (54, [0]), (53, [0, 2]), (3, [0, 1, 2])],
)
def test_those_that_free_most_vertices_for_a_pixel_become_masks_first(most: int, masked: list[int]) -> None:
    found = [zigzag(40, 10), zigzag(4, 100), zigzag(50, 200)]
    limits = replace(DEFAULT_LIMITS, max_vertices=most)
    assert np.flatnonzero(to_be_masked(found, limits)).tolist() == masked


@both_formats
@pytest.mark.parametrize("limit", ["max_polygons", "annotation_bytes", "mask_pixels"])
def test_what_could_not_be_read_back_is_not_written(write: Callable[..., bytes], limit: str) -> None:
    limits = replace(DEFAULT_LIMITS, max_vertices=0, **{limit: 5})
    with pytest.raises(InputError, match="ask for fewer regions") as refused:
        write(regions(nested), "a.png", limits)
    assert refused.value.code == "annotations-too-large"
