"""Triangulations against areas and neighbours, and patches that spread from segments."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from gcvec.patches.segment_table import segment_between, segment_table
from gcvec.patches.triangulation import constrained_delaunay, patch_triangulation
from tests.gcvec.areas import areas, shoelace


def test_delaunay_keeps_constraints_and_drops_what_lies_outside() -> None:
    vertices = np.array([[0, 0], [8, 0], [8, 8], [4, 1], [0, 8.0], [1, 2]])
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 0]])
    triangles, neighbours = constrained_delaunay(vertices, ring)
    assert areas(vertices, triangles).min() > 0
    assert areas(vertices, triangles).sum() == pytest.approx(shoelace(vertices[[0, 1, 2, 3, 4]]))
    edges = {frozenset(e) for t in triangles.tolist() for e in zip(t, t[1:] + t[:1], strict=True)}
    assert {frozenset(e) for e in ring.tolist()} <= edges
    for t, around in enumerate(neighbours):
        for k, other in enumerate(around):
            edge = {int(triangles[t, k]), int(triangles[t, (k + 1) % 3])}
            if other >= 0:
                assert edge <= set(triangles[other].tolist())
            else:
                assert any(edge == set(e) for e in ring.tolist())


def test_ties_are_broken_by_the_order_of_vertices_alone() -> None:
    """Samples on a lattice, nothing but ties: the same order of vertices makes the same mesh."""
    y, x = np.mgrid[:6, :7]
    vertices = np.stack([x.ravel(), y.ravel()], axis=1).astype(float)
    ring = np.flatnonzero((x.ravel() == 0) | (x.ravel() == 6) | (y.ravel() == 0) | (y.ravel() == 5))
    angle = np.arctan2(vertices[ring, 1] - 2.5, vertices[ring, 0] - 3)
    ring = ring[np.argsort(angle)]
    segments = np.stack([ring, np.roll(ring, -1)], axis=1)
    expected, _ = constrained_delaunay(vertices, segments)
    assert len(expected) == 2 * 5 * 6
    for shift in (0.0, 1000.0):
        again, _ = constrained_delaunay(vertices.copy() + shift, segments[::-1])
        np.testing.assert_array_equal(again, expected)


def test_segments_are_found_from_either_end() -> None:
    rng = np.random.default_rng(2)
    pairs = np.array([(a, b) for a in range(30) for b in range(a)])
    chosen = rng.permutation(pairs)[:90]
    segments = np.where(rng.random((90, 1)) < 0.5, chosen, chosen[:, ::-1])
    table = segment_table(segments, 30)
    place = {frozenset(ends): i for i, ends in enumerate(segments.tolist())}
    for a in range(-3, 33):
        for b in range(-3, 33):
            assert segment_between(table, a, b) == place.get(frozenset({a, b}), -1)


def test_patches_spread_from_their_segments() -> None:
    """A square cut in two by a zigzag, and points on either side."""
    rng = np.random.default_rng(0)
    zigzag = np.array([[40, 0], [55, 25], [30, 50], [60, 80], [50, 100.0]])
    corners = np.array([[0, 0], [100, 0], [100, 100], [0, 100.0]])
    points = rng.uniform(1, 99, (300, 2))
    vertices = np.concatenate([corners, zigzag, points])
    frame = [(0, 4, 0), (4, 1, 1), (1, 2, 1), (2, 8, 1), (8, 3, 0), (3, 0, 0)]
    segments = np.array([(a, b) for a, b, _ in frame] + [(a, a + 1) for a in range(4, 8)])
    sides = np.array([(p, -1) for *_, p in frame] + [(0, 1)] * 4)
    triangles, patch = patch_triangulation(vertices, segments, sides, 100)
    area = areas(vertices, triangles)
    left = shoelace(vertices[[0, 4, 5, 6, 7, 8, 3]])
    assert area.min() > 0
    assert np.bincount(patch, area).tolist() == pytest.approx([left, 10_000 - left])
    middle = vertices[triangles].mean(axis=1)
    on_left = middle[:, 0] < np.interp(middle[:, 1], zigzag[:, 1], zigzag[:, 0])
    np.testing.assert_array_equal(patch, np.where(on_left, 0, 1))
    rows = vertices[triangles, 1].sum(axis=1).astype(int)
    assert (np.diff(rows) >= 0).all()


def test_without_cuts_it_is_the_delaunay_triangulation() -> None:
    rng = np.random.default_rng(1)
    vertices = np.concatenate([[[0, 0], [64, 0], [64, 64], [0, 64.0]], rng.uniform(1, 63, (200, 2))])
    ring = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])
    triangles, patch = patch_triangulation(vertices, ring, np.full((4, 2), 7), 64)
    assert (patch == 7).all()
    assert {frozenset(t) for t in triangles.tolist()} >= {
        frozenset(t) for t in Delaunay(vertices).simplices.tolist()
    }
