"""Canvases without fold-over: which points stay, and which polygons come closer to their curves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gcvec.curves.domain import FINEST_LEVEL
from gcvec.patches import canonical
from gcvec.patches.canonical import Canvas, lay_canvas, lay_unfolded_canvas, refined_domains
from gcvec.patches.drawing import folded
from gcvec.patches.mesh import jitter
from tests.gcvec.scenes import clear_of_edges, foundation_of, no_points, some_points

Folded = Callable[[np.ndarray, np.ndarray], np.ndarray]


def assert_holds(canvas: Canvas, points: np.ndarray) -> None:
    """The canvas is the one with these control points."""
    mesh = canvas.mesh
    np.testing.assert_array_equal(mesh.vertices[mesh.n_samples : mesh.first_free], jitter(points))


def near_edges(scene: str, n: int) -> np.ndarray:
    """Random pixels of a scene, some of them so near to an edge that they make triangles fold."""
    ys, xs = np.nonzero(clear_of_edges(foundation_of(scene), 0.16))
    chosen = np.sort(np.random.default_rng(0).permutation(len(xs))[:n])
    return np.stack([xs[chosen], ys[chosen]], axis=1)


def test_points_whose_triangles_fold_are_left_out() -> None:
    foundation, points = foundation_of("voronoi"), near_edges("voronoi", 200)
    assert len(lay_canvas(foundation, points).foldovers()) > 0
    canvas, kept = lay_unfolded_canvas(foundation, points)
    assert len(canvas.foldovers()) == 0
    assert 0 < (~kept).sum() < 10
    assert canvas.foundation is foundation
    assert_holds(canvas, points[kept])


def test_points_that_do_no_harm_stay() -> None:
    foundation = foundation_of("quadrants")
    points = some_points(foundation, 80)
    canvas, kept = lay_unfolded_canvas(foundation, points)
    assert kept.all()
    assert_holds(canvas, points)


def test_of_points_left_out_one_after_another_it_is_known_which_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As if triangles folded around some points, and around others as soon as those are gone."""
    foundation, points = foundation_of("quadrants"), some_points(foundation_of("quadrants"), 60)
    unwanted = [[tuple(p) for p in jitter(points[own])] for own in ([3, 40], [10, 11], [55])]

    def fold(vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        for group in unwanted:
            at = [v for v, place in enumerate(vertices) if tuple(place) in group]
            if at:
                return np.flatnonzero(np.isin(triangles, at).any(axis=1))
        return np.zeros(0, np.int64)

    monkeypatch.setattr(Canvas, "foldovers", lambda canvas: fold(canvas.mesh.vertices, canvas.mesh.triangles))
    left = {tuple(p) for p in points.tolist()}
    while True:
        now = np.array([p for p in points.tolist() if tuple(p) in left])
        mesh = lay_canvas(foundation, now).mesh
        corners = mesh.triangles[fold(mesh.vertices, mesh.triangles)].ravel() - mesh.n_samples
        gone = {tuple(now[k]) for k in corners if 0 <= k < len(now)}
        if not gone:
            break
        left -= gone
    canvas, kept = lay_unfolded_canvas(foundation, points)
    assert {tuple(p) for p in points[kept].tolist()} == left
    assert len(left) < 50
    assert_holds(canvas, points[kept])


def fold_at_first(monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    """Have a triangle between three samples of curves inside the picture fold once; its corners."""
    foundation = foundation_of("voronoi")
    mesh = foundation.geometry.mesh
    between = mesh.triangles[(mesh.triangles < mesh.n_samples).all(axis=1)]
    inside = np.array([not curve.on_frame for curve in foundation.network.curves])
    curve = foundation.samples.curve[between]
    corners: np.ndarray = between[((curve >= 0) & inside[curve]).all(axis=1)][0]
    again: list[Folded] = [lambda _, triangles: np.flatnonzero((triangles == corners).all(axis=1))]
    monkeypatch.setattr(canonical, "folded", lambda *mesh: (again.pop() if again else folded)(*mesh))
    return corners


def test_a_fold_without_points_draws_polygons_closer_to_their_curves(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four times as close those that pass through its corners, and no others."""
    before = foundation_of("voronoi")
    corners = fold_at_first(monkeypatch)
    canvas, kept = lay_unfolded_canvas(before, no_points())
    assert kept.shape == (0,)
    touched = set(before.samples.curve[corners].tolist())
    after = canvas.foundation.network.curves
    assert [c for c, curve in enumerate(before.network.curves) if after[c].level != curve.level] == sorted(
        touched
    )
    assert all(after[c].level == before.network.curves[c].level + 2 for c in touched)
    assert canvas.foundation.space is before.space


def test_curves_end_in_nodes_that_fold() -> None:
    """All that end there come closer, but those on the frame, which are straight."""
    before = foundation_of("voronoi")
    curves = before.network.curves
    node = next(c.start for c in curves if not c.on_frame and not c.closed)
    after = refined_domains(before, np.array([[node, node, node]]))
    assert after is not None
    at_node = [c for c, curve in enumerate(curves) if node in (curve.start, curve.end) and not curve.on_frame]
    changed = [c for c, curve in enumerate(curves) if after.network.curves[c].level != curve.level]
    assert changed == at_node


def test_polygons_that_go_through_all_samples_come_no_closer() -> None:
    foundation = foundation_of("voronoi")
    corners = foundation.samples.segments[:, [0, 1, 1]]
    for _ in range(FINEST_LEVEL // 2 - 1):
        finer = refined_domains(foundation, corners)
        assert finer is not None
        foundation = finer
    assert refined_domains(foundation, corners) is None
    assert refined_domains(foundation, np.zeros((0, 3), np.int64)) is None
    inner = [curve for curve in foundation.network.curves if not curve.on_frame]
    assert {curve.level for curve in inner} == {FINEST_LEVEL}
