"""One colour at a time, against dense least squares."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.greedy.colors import NO_STEP, adapt, reach, usefulness
from tests.gcvec.greedy.gardens import PULL, alive, garden, whole_vertices


def slow_reach(plot, vertex: int) -> np.ndarray:
    """What a vertex gives to the pixels of its plot, looking at every triangle."""
    phi = np.zeros(len(plot.residual))
    for t in alive(plot):
        for k in np.flatnonzero(plot.triangles[t] == vertex):
            own = slice(plot.first[t], plot.last[t])
            np.add.at(phi, plot.pixel[own], plot.weights[own, k])
    return phi


def test_reach_is_that_of_all_triangles_about_a_vertex() -> None:
    (plot,) = garden("ring", 100).placement.plots
    for vertex in whole_vertices(plot)[::9]:
        slow = slow_reach(plot, vertex)
        *pressure, energy = reach(plot, vertex)
        np.testing.assert_allclose(pressure, slow @ plot.residual, rtol=1e-4, atol=1e-3)
        # Shares of a pixel count by themselves: by Jensen's inequality no less than together.
        together = (slow**2).sum()
        assert together * (1 - 1e-5) <= energy <= 1.25 * together


def test_reach_is_a_column_of_the_exact_fit_where_every_vertex_is_a_control_point() -> None:
    start = garden("voronoi", 400)
    (plot,) = start.placement.plots
    exact = start.fit.design.tocsc()
    for vertex in whole_vertices(plot)[::37]:
        at = int(
            np.flatnonzero((start.points[:, 1] * plot.width + start.points[:, 0]) == plot.seat[vertex])[0]
        )
        # Beside a curve the plot's triangles are straight, those of the fit are not.
        np.testing.assert_allclose(slow_reach(plot, vertex), exact[:, [at]].toarray().ravel(), atol=0.08)


def test_adapting_takes_a_step_towards_the_least_error_of_one_colour() -> None:
    (plot,) = garden("ring", 100).placement.plots
    for vertex in whole_vertices(plot)[::9]:
        phi, before = slow_reach(plot, vertex), plot.color[vertex].copy()
        without = plot.residual + phi[:, None] * before
        wanted = plot.photo[plot.seat[vertex]]
        best = np.clip((phi @ without + PULL * wanted) / (phi @ phi + PULL), 0, 1)
        adapt(plot, vertex, PULL)
        moved = plot.color[vertex] - before
        assert (np.abs(moved) <= np.abs(best - before) + 1e-4).all()
        assert (np.abs(plot.color[vertex] - best) <= 0.2 * np.abs(best - before) + NO_STEP).all()
        np.testing.assert_allclose(plot.residual, without - phi[:, None] * plot.color[vertex], atol=1e-5)


def test_adapting_again_and_again_finds_it() -> None:
    (plot,) = garden("ring", 100).placement.plots
    vertex = whole_vertices(plot)[30]
    phi = slow_reach(plot, vertex)
    without = plot.residual + phi[:, None] * plot.color[vertex]
    best = (phi @ without + PULL * plot.photo[plot.seat[vertex]]) / (phi @ phi + PULL)
    for _ in range(10):
        adapt(plot, vertex, PULL)
    np.testing.assert_allclose(plot.color[vertex], np.clip(best, 0, 1), atol=2 * NO_STEP)


def test_a_vertex_on_the_plane_of_its_neighbours_is_of_no_use() -> None:
    (plot,) = garden("ring", 100).placement.plots
    plot.color[:] = plot.image[:, :1] * [0.001, 0.002, -0.001] + plot.image[:, 1:] * 0.003
    vertex = whole_vertices(plot)[30]
    flat = usefulness(plot, vertex)
    plot.color[vertex] += 0.1
    *_, energy = reach(plot, vertex)
    assert flat < 1e-4 * usefulness(plot, vertex)
    assert usefulness(plot, vertex) == pytest.approx(3 * 0.01 * energy, rel=0.05)
