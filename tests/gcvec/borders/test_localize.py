"""What localising does along chains of samples, against the same chain by chain."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from gcvec.borders.border import Borders, sample_borders
from gcvec.borders.chains import Chains
from gcvec.borders.fairing import OVERLAP, STIFFNESS, faired
from gcvec.borders.localize import (
    CORNER_BLUR,
    DOUBT,
    NEAREST,
    NEIGHBOURS,
    REMOTE,
    SHADING,
    _beside_thin,
    _clear_of_nodes,
    _clearance,
    _ends_at_nodes,
    _limited,
    _nearest_other,
    _normals,
    _on_frame,
    _running_median,
    _spread,
    localized,
)
from gcvec.borders.planar_graph import planar_graph
from tests.gcvec.scenes import SCENES, Scene


def chains(sizes: tuple[int, ...], closed: tuple[bool, ...]) -> Chains:
    n = len(sizes)
    nodes = np.where(np.array(closed)[:, None], -1, np.arange(2 * n).reshape(n, 2))
    return Chains(np.arange(n), np.array(closed), nodes, np.cumsum([0, *sizes]))


MADE = chains((40, 9, 60, 3), (False, False, True, True))


def neighbours(k: int, size: int, closed: bool, reach: int) -> list[int]:
    around = range(k - reach, k + reach + 1)
    return [i % size if closed else i for i in around if closed or 0 <= i < size]


def test_running_median() -> None:
    rng = np.random.default_rng(0)
    values = np.where(rng.random(112) < 0.3, np.nan, rng.normal(size=112))
    values[:8] = np.nan
    found = _running_median(values, MADE.offsets, MADE.closed)
    assert (found == 0).sum() >= 2
    for first, end, closed in zip(MADE.offsets[:-1], MADE.offsets[1:], MADE.closed, strict=True):
        size = end - first
        for k in range(size):
            round_ = bool(closed) and size > 2 * SHADING
            near = values[first + np.array(neighbours(k, size, round_, SHADING))]
            known = np.sort(near[np.isfinite(near)])
            expected, n = 0.0, len(known)
            if n > SHADING:
                middle, spread = known[(n - 1) // 2], known[3 * n // 4] - known[n // 4]
                expected = middle / (1 + DOUBT * spread**2 / n / middle**2)
            assert found[first + k] == pytest.approx(expected, abs=1e-9)


def test_trust_spreads_from_the_best_neighbour() -> None:
    trust = np.random.default_rng(1).random(112)
    found = _spread(trust, MADE.offsets, MADE.closed)
    for first, end, closed in zip(MADE.offsets[:-1], MADE.offsets[1:], MADE.closed, strict=True):
        for k in range(end - first):
            near = first + np.array(neighbours(k, end - first, bool(closed), NEIGHBOURS))
            assert found[first + k] == trust[near].max()


@pytest.mark.parametrize("n", [2, 3, 50, 400])
def test_nearest_other_node(n: int) -> None:
    nodes = np.random.default_rng(n).integers(0, 40, (n, 2)).astype(float)
    distance = np.hypot(*(nodes[:, None] - nodes[None]).T)
    np.fill_diagonal(distance, np.inf)
    nearest = distance.min(axis=1)
    np.testing.assert_allclose(_nearest_other(nodes), np.where(nearest < REMOTE, nearest, np.inf))


def test_one_node_has_no_neighbour() -> None:
    assert _nearest_other(np.zeros((1, 2))).tolist() == [np.inf]


def test_fairing_minimises_what_it_says() -> None:
    rng = np.random.default_rng(2)
    made = chains((30, 50), (False, True))
    points, weight = rng.normal(size=(80, 2)), rng.uniform(0.01, 1, 80)
    found = faired(made, points, weight)
    for first, end, closed in ((0, 30, False), (30, 80, True)):
        n = end - first
        second = np.zeros((n if closed else n - 2, n))
        for row, k in enumerate(range(n) if closed else range(1, n - 1)):
            second[row, [(k - 1) % n, k, (k + 1) % n]] += [1, -2, 1]
        own = weight[first:end] + 1e-6
        if not closed:
            own[[0, -1]] = 1e6
        matrix = np.diag(own) + STIFFNESS * second.T @ second
        expected = np.linalg.solve(matrix, own[:, None] * points[first:end])
        # Closed chains are cut open a few samples further on.
        np.testing.assert_allclose(found[first:end], expected, atol=2e-3 if closed else 1e-6)
    assert OVERLAP >= 16


nodes_apart = hnp.arrays(
    float, st.tuples(st.integers(2, 12), st.just(2)), elements=st.integers(0, 12)
).filter(lambda nodes: len(np.unique(nodes, axis=0)) == len(nodes))


@settings(max_examples=50)
@given(nodes_apart)
def test_nodes_cannot_change_places(nodes: np.ndarray) -> None:
    """Those of a label map are a pixel apart or more: no two of them can meet, however they move."""
    reach = _clearance(nodes)
    distance = np.hypot(*(nodes[:, None] - nodes[None]).T)
    np.fill_diagonal(distance, np.inf)
    assert (reach[:, None] + reach[None] < distance)[distance < REMOTE].all()
    assert (reach >= 0.45).all()


def test_a_node_far_from_others_moves_as_it_likes() -> None:
    assert _clearance(np.array([[0.0, 0.0], [REMOTE + 1, 0.0]])).tolist() == [np.inf, np.inf]


def test_shifts_are_cut_to_their_largest_in_the_same_direction() -> None:
    shift = np.array([[3.0, 4.0], [0.3, -0.4], [0.0, 0.0], [-6.0, 0.0]])
    found = _limited(shift, np.array([1.0, 1.0, 1.0, np.inf]))
    np.testing.assert_allclose(found, [[0.6, 0.8], [0.3, -0.4], [0, 0], [-6, 0]])


def quartered() -> Borders:
    """Four regions, twelve pixels by ten, that meet in (5, 6)."""
    labels = np.zeros((10, 12), np.int32)
    labels[:6, 5:], labels[6:, :5], labels[6:, 5:] = 1, 2, 3
    return sample_borders(planar_graph(labels), 12, 10)


def test_nodes_on_the_frame_stay_on_their_side_of_it() -> None:
    traced = quartered()
    wanted = _on_frame(traced.nodes + np.array([0.5, 0.25]), traced)
    x, y = traced.nodes.T
    np.testing.assert_array_equal(wanted[:, 0], np.where((x == 0) | (x == 12), x, x + 0.5))
    np.testing.assert_array_equal(wanted[:, 1], np.where((y == 0) | (y == 10), y, y + 0.25))
    far = _on_frame(traced.nodes + 100, traced)
    assert (far <= [12, 10]).all()
    assert (_on_frame(traced.nodes - 100, traced) >= 0).all()


def test_ends_of_borders_are_counted_at_their_nodes() -> None:
    """Four in the middle, three where a border meets the frame, two in its corners."""
    traced = quartered()
    counted = dict(zip(map(tuple, traced.nodes.tolist()), _ends_at_nodes(traced).tolist(), strict=True))
    assert counted.pop((5.0, 6.0)) == 4
    assert [counted.pop(place) for place in ((5.0, 0.0), (5.0, 10.0), (0.0, 6.0), (12.0, 6.0))] == [3] * 4
    assert sorted(counted.values()) == [2] * 4


def test_samples_count_the_less_the_nearer_they_are_to_a_node() -> None:
    """Not at all next to it, wholly beyond its blur; in between as the square of how far they are."""
    n = 61
    points = np.stack([np.linspace(0, 15, n), np.zeros(n)], axis=1)
    made = chains((n,), (False,))
    found = _clear_of_nodes(made, points, points[[0, -1]], np.full(2, CORNER_BLUR))
    away = np.minimum(points[:, 0], 15 - points[:, 0])
    expected = np.clip((away - NEAREST) / (CORNER_BLUR - NEAREST), 0, 1) ** 2
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert found[0] == 0 < found[5] < found[10] == 1


def test_the_middle_of_a_short_border_counts() -> None:
    """Though all of it is nearer to its nodes than their blur reaches."""
    points = np.stack([np.arange(4.0), np.zeros(4)], axis=1)
    made = chains((4,), (False,))
    found = _clear_of_nodes(made, points, points[[0, -1]], np.full(2, 30.0))
    assert found[0] == found[-1] == 0
    assert found[1] == found[2] > 0.1


def test_closed_borders_have_no_ends() -> None:
    points = np.random.default_rng(0).uniform(0, 1, (20, 2))
    assert (_clear_of_nodes(chains((20,), (True,)), points, np.zeros((1, 2)), np.ones(1)) == 1).all()


def test_normals_point_to_the_right() -> None:
    """With y downwards: of a circle that is walked clockwise on the screen, to its middle."""
    angle = np.linspace(0, 2 * np.pi, 81)[:-1]
    points = 12 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    np.testing.assert_allclose(_normals(chains((80,), (True,)), points), -points / 12, atol=1e-12)


@pytest.mark.parametrize("scene", ["voronoi", "needles"])
def test_where_borders_may_not_move_junctions_stay(scene: str) -> None:
    """Both are cut at the same corners, between the same regions."""
    made = SCENES[scene]
    traced = sample_borders(planar_graph(made.labels), made.width, made.height)
    before, after = localized(traced, made.labels, made.picture() / 255.0, 0.0)
    for a, b in zip(before.borders, after.borders, strict=True):
        assert (a.left, a.right, a.start, a.end) == (b.left, b.right, b.start, b.end)
    junctions = _ends_at_nodes(after) >= 3
    assert junctions.sum() > 3
    np.testing.assert_array_equal(after.nodes[junctions], before.nodes[junctions])


def test_borders_of_a_sharp_disc_come_to_lie_on_it() -> None:
    """To a few hundredths of a pixel; the label map knows it to half a pixel."""
    disc = Scene(60, 64, lambda x, y: (np.hypot(x - 31.3, y - 29.8) < 20.4).astype(int))
    traced = sample_borders(planar_graph(disc.labels), 64, 60)
    before, after = localized(traced, disc.labels, disc.picture() / 255.0)
    circle = shapely.Point(31.3, 29.8).buffer(20.4, quad_segs=256).exterior
    off = [
        float(shapely.distance(circle, shapely.points(b.samples)).max())
        for found in (before, after)
        for b in found.borders
        if not b.on_frame
    ]
    assert off[0] > 0.3
    assert off[1] < 0.06


@pytest.mark.parametrize("width", [2.0, 3.0, 4.0])
def test_borders_of_a_thin_ring_come_to_lie_on_its_circles(width: float) -> None:
    """Thinner than the flanks that a step is measured from. The label map leaves a quarter of a pixel."""

    def owner(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        r = np.hypot(x - 31.3, y - 29.8)
        return ((r < 20.4) & (r > 20.4 - width)).astype(int)

    ring = Scene(60, 64, owner)
    traced = sample_borders(planar_graph(ring.labels), 64, 60)
    _, after = localized(traced, ring.labels, ring.picture() / 255.0)
    inside = [border for border in after.borders if not border.on_frame]
    assert len(inside) == 2
    for border in inside:
        r = np.hypot(*(border.samples - [31.3, 29.8]).T)
        off = r - (20.4 if r.mean() > 20.4 - width / 2 else 20.4 - width)
        assert np.sqrt((off**2).mean()) < 0.06


def test_thin_is_what_ends_within_a_few_pixels() -> None:
    """A stripe 3 pixels wide, and the space beside it, which goes on to the frame 3 pixels further on."""
    labels = np.zeros((20, 30), np.int32)
    labels[:, 12:15], labels[:, 15:] = 1, 2
    points = np.array([[12.0, 9.5], [15.0, 9.5], [28.0, 9.5], [6.0, 9.5]])
    sides = np.array([[0, 1], [1, 2], [2, 2], [0, 0]])
    right = np.tile([1.0, 0.0], (4, 1))
    expected = np.array([[False, True], [True, False], [False, False], [False, False]])
    np.testing.assert_array_equal(_beside_thin(labels, sides, points, right), expected)
    turned = _beside_thin(labels, sides[:, ::-1].copy(), points, -right)
    np.testing.assert_array_equal(turned, expected[:, ::-1])
