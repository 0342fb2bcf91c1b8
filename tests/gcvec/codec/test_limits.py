"""What a file may claim: each bound is kept by one more and one less."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders.planar_graph import MOST_AT_NODE, OUTSIDE
from gcvec.codec.limits import (
    PIXELS_A_BYTE,
    POINTS_A_BYTE,
    TEXT_A_BYTE,
    check_places,
    check_points,
    check_sizes,
    check_steps,
    check_text,
    check_topology,
    control_counts,
    shortest_stream,
)
from gcvec.codec.topology import END, LEFT_PATCH, LEVEL, RIGHT_PATCH, SEGMENTS, START
from gcvec.curves.domain import FINEST_LEVEL
from gcvec.photo import MOST_PIXELS
from gcvec.quantization import Quantization

PLENTY = 1 << 20


@pytest.mark.parametrize(
    ("width", "height", "nodes", "curves", "patches", "stream"),
    [
        (1, 1, 0, 1, 1, 1),
        (PIXELS_A_BYTE, 10, 0, 1, 1, 10),
        (MOST_PIXELS, 1, 0, 1, 1, PLENTY),
        (1, MOST_PIXELS, 0, 1, 1, PLENTY),
        (9, 9, 0, POINTS_A_BYTE * 10, 1, 10),
        (9, 9, 6, 3, 3, 10),
    ],
)
def test_the_largest_sizes(
    width: int, height: int, nodes: int, curves: int, patches: int, stream: int
) -> None:
    check_sizes(width, height, nodes, curves, patches, stream)


@pytest.mark.parametrize(
    ("width", "height", "nodes", "curves", "patches", "stream"),
    [
        (0, 1, 0, 1, 1, 1),
        (1, 0, 0, 1, 1, 1),
        (-1, -1, 0, 1, 1, 1),
        (PIXELS_A_BYTE, 10, 0, 1, 1, 9),
        (MOST_PIXELS + 1, 1, 0, 1, 1, PLENTY),
        (1, MOST_PIXELS + 1, 0, 1, 1, PLENTY),
        (1 << 13, (1 << 13) + 1, 0, 1, 1, PLENTY),
        (9, 9, 0, POINTS_A_BYTE * 10 + 1, 1, 10),
        (9, 9, 0, 0, 0, 10),
        (9, 9, 7, 3, 3, 10),
        (9, 9, -1, 3, 3, 10),
        (9, 9, 0, 3, 4, 10),
        (9, 9, 0, 3, 0, 10),
    ],
)
def test_sizes_beyond_them(
    width: int, height: int, nodes: int, curves: int, patches: int, stream: int
) -> None:
    with pytest.raises(ValueError, match="impossible"):
        check_sizes(width, height, nodes, curves, patches, stream)


def test_a_stream_is_as_long_as_what_it_holds_asks_for() -> None:
    """And no longer: a byte less is refused for each of them."""
    assert shortest_stream(PIXELS_A_BYTE, 7, 0, 0) == 7
    assert shortest_stream(PIXELS_A_BYTE + 1, 7, 0, 0) == 8
    assert shortest_stream(1, 1, POINTS_A_BYTE * 9, 0) == 9
    assert shortest_stream(1, 1, POINTS_A_BYTE * 9 + 1, 0) == 10
    assert shortest_stream(1, 1, 0, TEXT_A_BYTE * 5) == 5
    assert shortest_stream(1, 1, 0, TEXT_A_BYTE * 5 + 1) == 6
    for check, most in ((check_points, POINTS_A_BYTE), (check_text, TEXT_A_BYTE)):
        check(most * 9, 9)
        with pytest.raises(ValueError, match=r"too many|impossible"):
            check(most * 9 + 1, 9)
    with pytest.raises(ValueError, match="labels"):
        check_text(-1, 9)


def test_steps() -> None:
    for fine in (Quantization(0, 1, 1), Quantization(12, 1, 1)):
        check_steps(fine)
    for wrong in (Quantization(-1), Quantization(13), Quantization(4, 0, 1), Quantization(4, 1, 0)):
        with pytest.raises(ValueError, match="impossible steps"):
            check_steps(wrong)


def square() -> np.ndarray:
    """One patch in four straight curves along the frame, and a closed one with another patch inside."""
    table = np.zeros((5, 7), np.int64)
    table[:4, START], table[:4, END] = range(4), [1, 2, 3, 0]
    table[:, LEFT_PATCH], table[:, SEGMENTS] = OUTSIDE, 1
    table[4, [LEFT_PATCH, RIGHT_PATCH, START, END, SEGMENTS]] = 0, 1, -1, -1, 3
    return table


def test_a_sound_topology() -> None:
    check_topology(square(), 4, 2, PLENTY)
    assert control_counts(square()).tolist() == [4, 4, 4, 4, 3]


@pytest.mark.parametrize(
    ("curve", "column", "value"),
    [
        (0, RIGHT_PATCH, 2),
        (0, LEFT_PATCH, OUTSIDE - 1),
        (4, LEFT_PATCH, 1),
        (0, START, 4),
        (0, END, -1),
        (4, START, -2),
        (4, END, 0),
        (0, LEVEL, -1),
        (0, LEVEL, FINEST_LEVEL + 1),
        (0, SEGMENTS, 0),
        (4, SEGMENTS, 2),
    ],
)
def test_one_wrong_entry_of_a_topology_is_noticed(curve: int, column: int, value: int) -> None:
    table = square()
    table[curve, column] = value
    with pytest.raises(ValueError, match=r"a curve|an impossible level"):
        check_topology(table, 4, 2, PLENTY)


def test_a_node_has_curves() -> None:
    with pytest.raises(ValueError, match="a node without curves"):
        check_topology(square(), 5, 2, PLENTY)


@pytest.mark.parametrize(("more", "fits"), [(0, True), (1, False)])
def test_only_so_many_curves_meet_in_a_node(more: int, fits: bool) -> None:
    """Loops from a node to itself have two ends there."""
    table = np.zeros((MOST_AT_NODE // 2 + more, 7), np.int64)
    table[:, LEFT_PATCH], table[:, SEGMENTS] = OUTSIDE, 1
    if fits:
        check_topology(table, 1, 1, PLENTY)
    else:
        with pytest.raises(ValueError, match="too many curves at a node"):
            check_topology(table, 1, 1, PLENTY)


def test_curves_and_their_control_points_count_together() -> None:
    """Five curves with nineteen control points."""
    check_topology(square(), 4, 2, 12)
    with pytest.raises(ValueError, match="too many control points"):
        check_topology(square(), 4, 2, 11)


@pytest.mark.parametrize("place", [(-50, 0), (70, 0), (0, -50), (0, 80)])
def test_control_points_stay_within_width_and_height_of_the_picture(place: tuple[float, float]) -> None:
    places = np.array([(0.0, 0.0), place])
    check_places(places, 20, 30)
    with pytest.raises(ValueError, match="far"):
        check_places(places + np.sign(places) / 16, 20, 30)
