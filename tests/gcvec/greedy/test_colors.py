"""One colour at a time, against dense least squares."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.greedy.colors import NO_STEP, adapt, reach, usefulness
from gcvec.greedy.strip import VERTICES
from tests.gcvec.greedy.gardens import PULL, alive, garden, whole_vertices


def slow_reach(strip, vertex: int) -> np.ndarray:
    """What a vertex gives to the pixels of its strip, looking at every triangle."""
    phi = np.zeros(len(strip.residual))
    for t in alive(strip):
        for k in np.flatnonzero(strip.triangles[t] == vertex):
            own = slice(strip.first[t], strip.last[t])
            np.add.at(phi, strip.pixel[own], strip.weights[own, k])
    return phi


def test_reach_is_that_of_all_triangles_about_a_vertex() -> None:
    (strip,) = garden("ring", 100).placement.strips
    for vertex in whole_vertices(strip)[::9]:
        slow = slow_reach(strip, vertex)
        *pressure, energy = reach(strip, vertex)
        np.testing.assert_allclose(pressure, slow @ strip.residual, rtol=1e-4, atol=1e-3)
        # Shares of a pixel count by themselves: by Jensen's inequality no less than together.
        together = (slow**2).sum()
        assert together * (1 - 1e-5) <= energy <= 1.25 * together


def test_reach_is_a_column_of_the_exact_fit_where_every_vertex_is_a_control_point() -> None:
    start = garden("voronoi", 400)
    (strip,) = start.placement.strips
    exact = start.fit.design.tocsc()
    for vertex in whole_vertices(strip)[::37]:
        at = int(
            np.flatnonzero((start.points[:, 1] * strip.width + start.points[:, 0]) == strip.seat[vertex])[0]
        )
        # Beside a curve the strip's triangles are straight, those of the fit are not.
        np.testing.assert_allclose(slow_reach(strip, vertex), exact[:, [at]].toarray().ravel(), atol=0.08)


def test_adapting_takes_a_step_towards_the_least_error_of_one_colour() -> None:
    (strip,) = garden("ring", 100).placement.strips
    for vertex in whole_vertices(strip)[::9]:
        phi, before = slow_reach(strip, vertex), strip.color[vertex].copy()
        without = strip.residual + phi[:, None] * before
        wanted = strip.photo[strip.seat[vertex]]
        best = np.clip((phi @ without + PULL * wanted) / (phi @ phi + PULL), 0, 1)
        adapt(strip, vertex, PULL)
        moved = strip.color[vertex] - before
        assert (np.abs(moved) <= np.abs(best - before) + 1e-4).all()
        assert (np.abs(strip.color[vertex] - best) <= 0.2 * np.abs(best - before) + NO_STEP).all()
        np.testing.assert_allclose(strip.residual, without - phi[:, None] * strip.color[vertex], atol=1e-5)


def test_adapting_again_and_again_finds_it() -> None:
    (strip,) = garden("ring", 100).placement.strips
    vertex = whole_vertices(strip)[30]
    phi = slow_reach(strip, vertex)
    without = strip.residual + phi[:, None] * strip.color[vertex]
    best = (phi @ without + PULL * strip.photo[strip.seat[vertex]]) / (phi @ phi + PULL)
    for _ in range(10):
        adapt(strip, vertex, PULL)
    np.testing.assert_allclose(strip.color[vertex], np.clip(best, 0, 1), atol=2 * NO_STEP)


def test_a_vertex_on_the_plane_of_its_neighbours_is_of_no_use() -> None:
    (strip,) = garden("ring", 100).placement.strips
    there = slice(strip.counts[VERTICES])  # beyond is room for others
    x, y = strip.image[there, :1], strip.image[there, 1:]
    strip.color[there] = x * [0.001, 0.002, -0.001] + y * 0.003
    vertex = whole_vertices(strip)[30]
    flat = usefulness(strip, vertex)
    strip.color[vertex] += 0.1
    *_, energy = reach(strip, vertex)
    assert flat < 1e-4 * usefulness(strip, vertex)
    assert usefulness(strip, vertex) == pytest.approx(3 * 0.01 * energy, rel=0.05)
