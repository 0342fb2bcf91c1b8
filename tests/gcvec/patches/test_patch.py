"""Equations (1) and (2): exact where the paper says so, and the classic Coons patch on a rectangle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import sparse

from gcvec.borders.planar_graph import OUTSIDE
from gcvec.curves import bspline
from gcvec.curves.network import straight_line
from gcvec.patches.canonical import Foundation, lay_foundation
from gcvec.patches.coons import coons
from gcvec.patches.harmonic import cotangent_laplacian
from gcvec.patches.mesh import Mesh, build_mesh
from gcvec.patches.patch import solve_blend
from tests.gcvec.scenes import SCENES, foundation_of, no_points, some_points


def operator(foundation: Foundation, coordinates: np.ndarray, columns: np.ndarray, patch: int) -> np.ndarray:
    """`coons` as a dense matrix from the control points of all curves to the rows of `coordinates`."""
    network, samples = foundation.network, foundation.samples
    edges = np.flatnonzero((network.sides[samples.edge_curve] == patch).any(axis=1))
    return coons(sparse.csr_array(coordinates), columns, edges, network.family, samples).toarray()


def curved(foundation: Foundation, seed: int, d: int = 2) -> np.ndarray:
    """Random control points for all curves, in agreement at nodes."""
    rng = np.random.default_rng(seed)
    offsets = foundation.samples.offsets
    control, nodes = rng.normal(size=(offsets[-1], d)), rng.normal(size=(foundation.network.n_nodes, d))
    for c, curve in enumerate(foundation.network.curves):
        if not curve.closed:
            control[offsets[c]], control[offsets[c + 1] - 1] = nodes[curve.start], nodes[curve.end]
    return control


def test_rectangle_with_bilinear_coordinates_is_the_classic_coons_patch() -> None:
    foundation = foundation_of("whole")
    network, samples = foundation.network, foundation.samples
    assert len(samples.edge_ends) == 4
    corners = np.unique(samples.edge_ends)
    size = np.array([network.width, network.height])
    u, v = np.random.default_rng(0).uniform(0, 1, (2, 50))
    at = samples.domain[corners] / size
    coordinates = np.where(at[:, 0] > 0, u[:, None], 1 - u[:, None])
    coordinates = coordinates * np.where(at[:, 1] > 0, v[:, None], 1 - v[:, None])
    control = curved(foundation, 1)

    def side(axis: int, end: int, t: np.ndarray) -> np.ndarray:
        """The frame's curve where coordinate `axis` is at `end`, by the other coordinate."""
        for c, curve in enumerate(network.curves):
            reach = curve.control_points[[0, -1]] / size
            if (reach[:, axis] == end).all():
                t = t if reach[0, 1 - axis] == 0 else 1 - t
                own = control[samples.offsets[c] : samples.offsets[c + 1]]
                return bspline.evaluate(own, curve.segments * t)
        raise AssertionError("no such side")

    def corner(i: int, j: int) -> np.ndarray:
        return side(1, j, np.array([float(i)]))

    u1, v1 = u[:, None], v[:, None]
    ruled = (1 - v1) * side(1, 0, u) + v1 * side(1, 1, u) + (1 - u1) * side(0, 0, v) + u1 * side(0, 1, v)
    bilinear = (
        (1 - u1) * (1 - v1) * corner(0, 0)
        + u1 * (1 - v1) * corner(1, 0)
        + (1 - u1) * v1 * corner(0, 1)
        + u1 * v1 * corner(1, 1)
    )
    ours = operator(foundation, coordinates, corners, 0) @ control
    np.testing.assert_allclose(ours, ruled - bilinear, atol=1e-12)


@pytest.mark.parametrize("scene", SCENES)
def test_boundary_curves_are_reproduced(scene: str) -> None:
    """At a boundary sample only the two coordinates of its edge differ from 0: S is the curve's own point."""
    foundation = foundation_of(scene)
    network, samples = foundation.network, foundation.samples
    control = curved(foundation, 2)
    on_curve = np.einsum("nk,nkd->nd", samples.weight, control[samples.control])
    for patch in range(len(network.loops)):
        of_patch = [c for c, k in enumerate(network.curves) if patch in (k.left, k.right)]
        own = np.flatnonzero(np.isin(samples.curve, of_patch))
        columns = np.unique(samples.ends[own])
        columns = np.union1d(columns, samples.edge_ends[np.isin(samples.edge_curve, of_patch)])
        coordinates = np.zeros((len(own), len(columns)))
        rows = np.arange(len(own))
        np.add.at(coordinates, (rows, np.searchsorted(columns, samples.ends[own, 0])), 1 - samples.along[own])
        np.add.at(coordinates, (rows, np.searchsorted(columns, samples.ends[own, 1])), samples.along[own])
        ours = operator(foundation, coordinates, columns, patch) @ control
        np.testing.assert_allclose(ours, on_curve[own], atol=1e-9)


def blended_mesh(scene: str, n_points: int) -> tuple[Foundation, Mesh]:
    foundation = foundation_of(scene)
    points = some_points(foundation, n_points, 1) if n_points else no_points()
    return foundation, build_mesh(foundation.network, foundation.samples, points)


def straight_quadrants() -> Foundation:
    """Four rectangles whose curves run straight at uniform speed: C_i(t) = (1 - t) p_i + t p_{i+1}."""
    network = foundation_of("quadrants").network
    curves = tuple(
        replace(k, control_points=straight_line(k.control_points[0], k.control_points[-1], k.segments))
        for k in network.curves
    )
    return lay_foundation(replace(network, curves=curves), np.zeros(len(curves), bool))


@pytest.mark.parametrize("n_points", [0, 6])
def test_straight_edges_make_the_identity(n_points: int) -> None:
    foundation = straight_quadrants()
    mesh = build_mesh(foundation.network, foundation.samples, some_points(foundation, n_points, 1))
    weights = solve_blend(foundation.network, foundation.samples, mesh)
    free = mesh.vertices[mesh.first_free :]
    assert len(free) > 5
    points = mesh.vertices[mesh.n_samples : mesh.first_free]
    np.testing.assert_allclose(
        weights.boundary @ foundation.control_points + weights.points @ points, free, atol=1e-9
    )
    np.testing.assert_allclose(foundation.geometry.image, foundation.geometry.mesh.vertices, atol=1e-9)


@pytest.mark.parametrize("n_points", [0, 6])
@pytest.mark.parametrize("scene", ["ring", "quadrants"])
def test_blend_weights_sum_to_one(scene: str, n_points: int) -> None:
    foundation, mesh = blended_mesh(scene, n_points)
    weights = solve_blend(foundation.network, foundation.samples, mesh)
    total = weights.boundary.sum(axis=1) + weights.points.sum(axis=1)
    np.testing.assert_allclose(total, 1, atol=1e-9)
    assert weights.points.shape == (len(total), mesh.n_points)
    assert (weights.points.data >= -1e-9).all()


def test_blend_solves_eq_1_with_the_harmonic_coordinates_of_the_whole_region() -> None:
    """Solved in clusters of free vertices or in one piece: the same."""
    foundation, mesh = blended_mesh("ring", 5)
    network, samples = foundation.network, foundation.samples
    weights = solve_blend(network, samples, mesh)
    ring = int(np.argmax([len(loops) * (k > 0) for k, loops in enumerate(network.loops)]))
    own = np.flatnonzero(mesh.patch == ring)
    assert len(network.loops[ring]) == 2
    used = np.unique(mesh.triangles[own])
    local = np.full(len(mesh.vertices), -1)
    local[used] = np.arange(len(used))
    laplacian = cotangent_laplacian(mesh.vertices[used], local[mesh.triangles[own]]).toarray()
    free = used >= mesh.first_free
    assert free.any()
    columns = np.unique(samples.ends[used[used < mesh.n_samples]])
    values = np.zeros((len(used), len(columns)))
    for i, vertex in enumerate(used):
        if vertex < mesh.n_samples:
            values[i, np.searchsorted(columns, samples.ends[vertex, 0])] += 1 - samples.along[vertex]
            values[i, np.searchsorted(columns, samples.ends[vertex, 1])] += samples.along[vertex]
    coordinates = np.linalg.solve(
        laplacian[np.ix_(free, free)], -laplacian[np.ix_(free, ~free)] @ values[~free]
    )
    expected = operator(foundation, coordinates, columns, ring)
    ours = weights.boundary.toarray()[used[free] - mesh.first_free]
    control = curved(foundation, 3)
    np.testing.assert_allclose(ours @ control, expected @ control, atol=1e-7)


@pytest.mark.parametrize("scene", SCENES)
def test_no_scene_folds_over(scene: str) -> None:
    foundation = foundation_of(scene)
    a, b, c = (foundation.geometry.image[foundation.geometry.mesh.triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    assert (ux * vy - uy * vx).min() > 0
    network = foundation.network
    assert (ux * vy - uy * vx).sum() / 2 == pytest.approx(network.width * network.height)
    assert all(k.left == OUTSIDE or k.right == OUTSIDE for k in network.curves if k.on_frame)


def test_pixels_find_their_triangle_and_patch() -> None:
    geometry = foundation_of("ring").geometry
    owner = geometry.triangle_at
    assert owner.min() >= 0
    y, x = np.mgrid[: owner.shape[0], : owner.shape[1]]
    centre = np.stack([x.ravel(), y.ravel()], axis=1) + 0.5
    corners = geometry.mesh.vertices[geometry.mesh.triangles[owner.ravel()]]
    for k in range(3):
        a, b = corners[:, k], corners[:, (k + 1) % 3]
        cross = (b - a)[:, 0] * (centre - a)[:, 1] - (b - a)[:, 1] * (centre - a)[:, 0]
        assert cross.min() >= -1e-9


def test_map_to_the_image_agrees_with_its_vertices() -> None:
    geometry = foundation_of("ring").geometry
    mesh = geometry.mesh
    middles = mesh.vertices[mesh.triangles].mean(axis=1)
    row, column = middles[:, 1].astype(int), middles[:, 0].astype(int)
    same = geometry.triangle_at[row, column] == np.arange(len(middles))
    assert same.sum() > 100
    expected = geometry.image[mesh.triangles].mean(axis=1)
    np.testing.assert_allclose(geometry.to_image(middles)[same], expected[same], atol=1e-9)
