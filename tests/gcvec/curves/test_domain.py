"""Parameter polygons of whole pictures: they tile, hug their curves and never cross."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gcvec.borders.border import sample_borders
from gcvec.borders.localize import localized
from gcvec.borders.planar_graph import planar_graph
from gcvec.curves import bspline
from gcvec.curves.domain import (
    FINEST_LEVEL,
    crossing_curves,
    polygon_edges,
    polygon_vertices,
    with_levels,
)
from gcvec.curves.network import Curve, Network
from gcvec.curves.network_fit import fitted_network
from gcvec.curves.sampling import SAGITTA, SPACING
from gcvec.quantization import Quantization
from gcvec.regions.components import connected_components
from tests.gcvec.curves.single_splines import fit_within
from tests.gcvec.plain_polygons import plain_polygon, plain_sample
from tests.gcvec.scenes import SCENES, drawn, foundation_of

GRID = Quantization().grid


def polygons(network: Network) -> list[shapely.Polygon]:
    """The parameter polygon of every region, with its holes."""
    samples = polygon_edges(network)
    owner, every = network.sampling.curve[samples[:, 0]], network.sampling.points[samples]
    edges = [every[owner == c] for c in range(len(network.curves))]
    result = []
    for loops in network.loops:
        rings = [
            np.concatenate([edges[c][:, 0] if forward else edges[c][::-1, 1] for c, forward in loop])
            for loop in loops
        ]
        area = [shapely.Polygon(r).area * (1 if shapely.LinearRing(r).is_ccw else -1) for r in rings]
        outer = int(np.argmax(area))
        result.append(shapely.Polygon(rings[outer], [r for k, r in enumerate(rings) if k != outer]))
    return result


def assert_tiling(network: Network) -> None:
    assert len(crossing_curves(network)) == 0
    parts = polygons(network)
    assert all(part.area > 0 for part in parts)
    assert sum(part.area for part in parts) == pytest.approx(network.width * network.height)
    union = shapely.union_all(parts)
    assert union.area == pytest.approx(network.width * network.height)


@pytest.mark.parametrize("scene", SCENES)
def test_polygons_tile_the_picture(scene: str) -> None:
    assert_tiling(foundation_of(scene).network)


@pytest.mark.parametrize("scene", SCENES)
def test_polygons_have_about_the_area_of_their_regions(scene: str) -> None:
    labels = SCENES[scene].labels
    for k, polygon in enumerate(polygons(foundation_of(scene).network)):
        pixels = labels == k
        assert abs(polygon.area - pixels.sum()) <= 0.5 * polygon.length


@settings(max_examples=60)
@given(
    owners=st.tuples(st.integers(1, 14), st.integers(1, 14)).flatmap(
        lambda shape: arrays(np.int32, shape, elements=st.integers(0, 2), fill=st.nothing())
    )
)
def test_any_label_map_ends_without_crossings(owners: np.ndarray) -> None:
    """Regions of a pixel, diagonal contacts, combs: worse than what slivers leave of real maps."""
    labels = connected_components(owners)
    height, width = labels.shape
    traced = sample_borders(planar_graph(labels), width, height)
    assert_tiling(fitted_network(traced, traced, GRID))
    noise = np.random.default_rng(owners.sum()).uniform(0, 1, (height, width, 3))
    assert_tiling(fitted_network(*localized(traced, labels, noise), GRID))
    clean = drawn(labels).picture() / 255
    assert_tiling(fitted_network(*localized(traced, labels, clean), GRID))


def line(*points: tuple[float, float], left: int = 0, right: int = 1) -> Curve:
    return Curve(np.array(points, float), left, right, 0, 1)


def test_crossing_curves_are_found() -> None:
    across = line((0, 0), (3, 3), (6, 6), (9, 9))
    against = Curve(np.array([(0, 9), (3, 6), (6, 3), (9, 0.0)]), 0, 1, 2, 3)
    beside = Curve(np.array([(20, 0), (20, 3), (20, 6), (20, 9.0)]), 0, 1, 4, 5)
    network = Network(30, 30, 6, (across, beside, against), ((), ()))
    assert crossing_curves(network).tolist() == [0, 2]


def test_curves_that_lie_on_each_other_cross() -> None:
    one = line((0, 0), (3, 0), (6, 0), (9, 0))
    other = line((0, 0), (2, 0), (4, 0), (6, 0))
    assert crossing_curves(Network(9, 9, 3, (one, other), ((), ()))).tolist() == [0, 1]


def test_curves_that_share_a_node_do_not_cross() -> None:
    one = line((0, 0), (3, 0), (6, 0), (9, 0))
    other = line((0, 0), (0, 3), (0, 6), (0, 9))
    assert len(crossing_curves(Network(9, 9, 3, (one, other), ((), ())))) == 0


def circle(radius: float) -> Curve:
    angle = np.linspace(0, 2 * np.pi, 300)
    samples = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return Curve(fit_within(samples, 0.05, 8, closed=True), 0, 1, -1, -1)


def alone(curve: Curve) -> Network:
    return Network(100, 100, 0, (curve,), ((),))


@pytest.mark.parametrize(("tip", "touches"), [((50.0, 50.0), True), ((49.0, 50.0), False)])
def test_a_vertex_in_the_place_of_another_curves_end_touches_it(
    tip: tuple[float, float], touches: bool
) -> None:
    slant = np.array([(40.0, 60.0), (45, 55), (50, 50), (55, 45), (60, 40)])
    post = np.linspace((20.0, 50.0), tip, 5)
    curves = Curve(slant, 0, 1, 0, 1), Curve(post, 0, 1, 2, 3)
    network = with_levels(Network(100, 100, 4, curves, ((), ())), FINEST_LEVEL)
    assert [50, 50] in network.sampling.points[network.sampling.curve == 0].tolist()
    assert crossing_curves(network).tolist() == ([0, 1] if touches else [])
    assert crossing_curves(network, [1]).tolist() == ([0, 1] if touches else [])


@pytest.mark.parametrize("radius", [2.0, 10.0, 100.0])
def test_samples_keep_spacing_and_sagitta(radius: float) -> None:
    curve = circle(radius)
    u = alone(curve).sampling.u
    assert (u[0], u[-1]) == (0, curve.segments)
    points = bspline.evaluate(curve.control_points, u, closed=True)
    # Pieces of one segment differ a little in length: uniform in u, not in arc length.
    assert np.hypot(*np.diff(points, axis=0).T).max() <= 1.1 * SPACING
    middles = bspline.evaluate(curve.control_points, (u[1:] + u[:-1]) / 2, closed=True)
    assert np.hypot(*(middles - (points[1:] + points[:-1]) / 2).T).max() <= SAGITTA


@pytest.mark.parametrize("level", [0, 1, 3])
def test_polygons_follow_curves_as_closely_as_their_level_says(level: int) -> None:
    curve = circle(40.0)
    network = with_levels(alone(curve), level)
    assert network.curves[0].level == level
    points = bspline.evaluate(curve.control_points, network.sampling.u, closed=True)
    vertices = np.flatnonzero(polygon_vertices(network))
    polygon = shapely.LineString(points[vertices])
    assert max(polygon.distance(shapely.Point(p)) for p in points) <= 0.5**level
    # Fewest: a regular polygon of n corners has the sagitta r (1 - cos(pi / n)).
    n = np.pi / np.arccos(1 - 0.5**level / 40)
    assert len(vertices) - 1 <= 2.5 * n


def test_closed_curves_have_at_least_three_edges() -> None:
    assert polygon_vertices(alone(circle(0.7))).sum() >= 4


def test_network_of_a_disc_shares_one_curve() -> None:
    labels = SCENES["ring"].labels
    traced = sample_borders(planar_graph(labels), labels.shape[1], labels.shape[0])
    network = fitted_network(traced, traced)
    inner = [c for c in network.curves if not c.on_frame]
    assert len(inner) == 2
    assert all(c.closed for c in inner)
    assert sorted(len(loops) for loops in network.loops) == [1, 2, 2]


@pytest.mark.parametrize("level", [0, 2, 5, FINEST_LEVEL])
@pytest.mark.parametrize("scene", ["needles", "nested"])
def test_samples_and_vertices_are_those_of_the_format_to_the_bit(scene: str, level: int) -> None:
    network = with_levels(foundation_of(scene).network, level)
    sampling, vertex = network.sampling, polygon_vertices(network)
    for c, curve in enumerate(network.curves):
        own = slice(*sampling.starts[c : c + 2])
        control = curve.control_points.tolist()
        samples = [plain_sample(control, curve.closed, u) for u in sampling.u[own].tolist()]
        assert [tuple(place) for place in sampling.points[own].tolist()] == samples
        assert np.flatnonzero(vertex[own]).tolist() == plain_polygon(samples, curve.closed, level)
