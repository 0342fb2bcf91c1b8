"""Borders of a made scene against its truth: corners, junctions and the arcs between them."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from examples.scenes import balls
from gcvec import Annotations
from gcvec.borders.border import sample_borders
from gcvec.borders.localize import localized
from gcvec.borders.planar_graph import planar_graph
from gcvec.curves import bspline
from gcvec.curves.domain import polygon_vertices
from gcvec.curves.network import Curve, Network
from gcvec.curves.network_fit import fitted_network
from gcvec.regions.partition import partition
from gcvec.regions.snap import snap_borders
from tests.gcvec.buildings import Buildings, buildings

PALE = np.array([109.9, 133.5])


def network_of(pixels: np.ndarray, annotations: Annotations) -> Network:
    height, width = pixels.shape[:2]
    picture = pixels / 255.0
    labels = snap_borders(partition(annotations, width, height).labels, picture, 2.5)
    return fitted_network(*localized(sample_borders(planar_graph(labels), width, height), labels, picture))


@pytest.fixture(scope="module", params=[0, 1])
def scene(request: pytest.FixtureRequest) -> Buildings:
    return buildings(request.param)


@pytest.fixture(scope="module")
def network(scene: Buildings) -> Network:
    return network_of(scene.pixels, scene.annotations)


def inner(network: Network) -> list[Curve]:
    return [curve for curve in network.curves if not curve.on_frame]


def nodes_with(network: Network, n_curves: range) -> np.ndarray:
    """Places `(k, 2)` of nodes off the frame in which so many curves end."""
    place = np.zeros((network.n_nodes, 2))
    ends = np.zeros(network.n_nodes, np.int64)
    for curve in network.curves:
        if not curve.closed:
            for node, point in zip((curve.start, curve.end), curve.control_points[[0, -1]], strict=True):
                place[node] = point
                ends[node] += 1
    inside = ((place > 0) & (place < [network.width, network.height])).all(axis=1)
    return np.asarray(place[inside & np.isin(ends, list(n_curves))])


def nearest(places: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.asarray(np.hypot(*np.moveaxis(truth[:, None] - places[None], -1, 0)).min(axis=1))


def points_of(curve: Curve) -> np.ndarray:
    u = np.linspace(0, curve.segments, 12 * curve.segments + 1)
    return bspline.evaluate(curve.control_points, u, curve.closed)


def test_curves_part_at_every_corner(scene: Buildings, network: Network) -> None:
    assert len(scene.corners) >= 12
    off = nearest(nodes_with(network, range(2, 3)), scene.corners)
    assert off.max() <= 0.2, scene.corners[off > 0.2]


def test_curves_part_nowhere_else(scene: Buildings, network: Network) -> None:
    found = nodes_with(network, range(2, 3))
    assert nearest(scene.corners, found).max() <= 1


def test_junctions_are_where_regions_meet(scene: Buildings, network: Network) -> None:
    assert len(scene.junctions) >= 20
    off = nearest(nodes_with(network, range(3, 9)), scene.junctions)
    # Where the pale hill ends at a wall, the photo hardly says how far up.
    pale = np.hypot(*(scene.junctions - PALE).T) < 1
    assert off[~pale].max() <= 0.3, scene.junctions[off > 0.3]
    assert off[pale].max() <= 0.5


def test_four_and_five_regions_meet_in_one_junction(scene: Buildings, network: Network) -> None:
    crowded = nodes_with(network, range(4, 9))
    for center in ((207.6, 118.9), (140.3, 41.6)):
        assert nearest(crowded, np.array([center])).max() <= 0.3


def test_arcs_follow_the_true_borders(scene: Buildings, network: Network) -> None:
    points = np.concatenate([points_of(curve) for curve in inner(network)])
    off = shapely.distance(scene.borders, shapely.points(points))
    assert np.sqrt((off**2).mean()) <= 0.04
    assert np.quantile(off, 0.99) <= 0.15


def test_curves_are_smooth_at_polygon_vertices(network: Network) -> None:
    sampling, vertex = network.sampling, polygon_vertices(network)
    for c, curve in enumerate(network.curves):
        if curve.on_frame:
            continue
        own = slice(*sampling.starts[c : c + 2])
        u = sampling.u[own][vertex[own]][1:-1]
        before, after = (_tangents(curve, u, side) for side in (-1, 1))
        turn = np.arctan2(
            before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], (before * after).sum(axis=1)
        )
        assert np.abs(turn).max(initial=0) < 1e-6


def _tangents(curve: Curve, u: np.ndarray, side: int) -> np.ndarray:
    """One-sided derivatives: exact, from the Bézier points of the segment on that side."""
    pieces = bspline.bezier(curve.control_points, curve.closed)
    segment = np.clip(np.ceil(u).astype(int) - 1 if side < 0 else np.floor(u).astype(int), 0, len(pieces) - 1)
    t = (u - segment)[:, None]
    step = np.diff(pieces[segment], axis=1)
    return np.asarray((1 - t) ** 2 * step[:, 0] + 2 * t * (1 - t) * step[:, 1] + t**2 * step[:, 2])


@pytest.mark.parametrize("seed", [0, 1])
def test_circles_are_round(seed: int) -> None:
    """Each ball's outline, shaded on both sides, as well where two balls overlap."""
    scene = balls(seed)
    arcs = inner(network_of(scene.pixels, scene.annotations))
    assert len(arcs) == len(scene.balls) + 1
    assert sum(curve.closed for curve in arcs) == 4
    for curve in arcs:
        off = scene.distance_to_circles(points_of(curve))
        assert np.sqrt((off**2).mean()) <= 0.045


def test_borders_run_straight_to_their_nodes(network: Network) -> None:
    """No hook: next to its ends, where the photo says little, a curve hardly turns."""
    for curve in inner(network):
        points = points_of(curve)
        way = np.diff(points, axis=0)
        run = np.cumsum(np.hypot(*way.T))
        angle = np.arctan2(way[:, 1], way[:, 0])
        turn = np.abs((np.diff(angle) + np.pi) % (2 * np.pi) - np.pi)
        for near in (run[:-1] < 3.5, run[:-1] > run[-1] - 3.5):
            assert curve.closed or np.rad2deg(turn[near].sum()) < 25
