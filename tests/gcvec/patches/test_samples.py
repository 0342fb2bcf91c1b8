"""Boundary samples lie where their curves and polygons say."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.curves import bspline
from tests.gcvec.scenes import SCENES, foundation_of


@pytest.mark.parametrize("scene", SCENES)
def test_samples_are_points_of_their_curves(scene: str) -> None:
    foundation = foundation_of(scene)
    network, samples = foundation.network, foundation.samples
    on_curve = np.einsum("nk,nkd->nd", samples.weight, foundation.control_points[samples.control])
    np.testing.assert_allclose(samples.weight.sum(axis=1), 1, atol=1e-12)
    for c, curve in enumerate(network.curves):
        own = samples.curve == c
        expected = bspline.evaluate(curve.control_points, samples.u[own], curve.closed)
        np.testing.assert_allclose(on_curve[own], expected, atol=1e-12)
        for node, end in ((curve.start, 0), (curve.end, -1)):
            if node >= 0:
                np.testing.assert_array_equal(on_curve[node], curve.control_points[end])


@pytest.mark.parametrize("scene", SCENES)
def test_polygon_vertices_are_fixed_by_the_map_and_others_divide_their_edge(scene: str) -> None:
    foundation = foundation_of(scene)
    samples = foundation.samples
    on_curve = np.einsum("nk,nkd->nd", samples.weight, foundation.control_points[samples.control])
    vertices = np.unique(samples.edge_ends)
    np.testing.assert_allclose(samples.domain[vertices], on_curve[vertices], atol=1e-12)
    assert (samples.along[vertices] == 0).all()
    a, b = samples.domain[samples.ends[:, 0]], samples.domain[samples.ends[:, 1]]
    np.testing.assert_allclose(samples.domain, a + samples.along[:, None] * (b - a), atol=1e-12)
    distance = np.hypot(*(samples.domain - on_curve).T)
    level = np.array([c.level for c in foundation.network.curves])
    inner = samples.curve >= 0
    # The fraction along an edge is the curve's parameter, so a sample may also slide a little along it.
    assert (distance[inner] <= 4 * 0.5 ** level[samples.curve[inner]]).all()


@pytest.mark.parametrize("scene", SCENES)
def test_segments_walk_each_curve_from_end_to_end(scene: str) -> None:
    foundation = foundation_of(scene)
    samples = foundation.samples
    for c, curve in enumerate(foundation.network.curves):
        own = samples.segment_curve == c
        walk, u = samples.segments[own], samples.segment_u[own]
        np.testing.assert_array_equal(walk[1:, 0], walk[:-1, 1])
        np.testing.assert_array_equal(u[1:, 0], u[:-1, 1])
        assert (u[:, 0] < u[:, 1]).all()
        assert (u[0, 0], u[-1, 1]) == (0, curve.segments)
        assert walk[-1, 1] == (walk[0, 0] if curve.closed else curve.end)
        # Every knot is a sample: segments lie within one polynomial piece.
        assert set(range(curve.segments)) <= set(u[:, 0].tolist())
