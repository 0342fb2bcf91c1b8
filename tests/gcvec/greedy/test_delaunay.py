"""The mesh that grows point by point is the one that is made of all points at once."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.greedy.delaunay import insert, remove
from gcvec.greedy.plot import NOBODY, VERTICES, Plot
from gcvec.patches.mesh import jitter
from gcvec.patches.triangulation import constrained_delaunay
from tests.gcvec.greedy.gardens import alive, garden, triangle_keys, whole_vertices
from tests.gcvec.scenes import some_points


def put(plot: Plot, pixel: np.ndarray, place: np.ndarray) -> bool:
    """Put a control point of a pixel at a place of the image into the plot."""
    v = plot.counts[VERTICES]
    plot.domain[v] = jitter(pixel[None])[0]
    plot.image[v], plot.color[v], plot.seat[v] = place, 0.5, 0
    for start in alive(plot):
        if insert(plot, v, start, plot.holes):
            plot.counts[VERTICES] += 1
            plot.whole[v] = True
            return True
    return False


def keys_of_mesh(vertices: np.ndarray, triangles: np.ndarray) -> set[frozenset[tuple[float, float]]]:
    return {frozenset((float(x), float(y)) for x, y in vertices[t]) for t in triangles}


@pytest.mark.parametrize("scene", ["ring", "quadrants", "voronoi"])
def test_points_put_in_and_taken_out_again(scene: str) -> None:
    start = garden(scene, 150)
    (plot,) = start.placement.plots
    before = triangle_keys(plot)
    assert before == keys_of_mesh(start.canvas.mesh.vertices, start.canvas.mesh.triangles)

    known = {tuple(p) for p in start.points.tolist()}
    more = [p for p in some_points(start.foundation, 120, seed=9) if tuple(p) not in known]
    places = start.foundation.geometry.to_image(jitter(np.array(more)))
    first = int(plot.counts[VERTICES])
    kept = [p for p, place in zip(more, places, strict=True) if put(plot, p, place)]
    assert len(kept) > 0.9 * len(more)

    # All at once gives the very same triangles.
    mesh, samples = start.canvas.mesh, start.foundation.samples
    sites = np.concatenate([mesh.vertices, jitter(np.array(kept))])
    triangles, _ = constrained_delaunay(sites, samples.segments)
    assert triangle_keys(plot) == keys_of_mesh(sites, triangles)

    for v in np.random.default_rng(1).permutation(np.arange(first, plot.counts[VERTICES])):
        assert remove(plot, v, plot.holes)
    assert triangle_keys(plot) == before


def test_neighbours_agree_and_nothing_folds() -> None:
    start = garden("voronoi", 80)
    start.placement.grow(0.3 * start.placement.error, 400)
    start.placement.thin_out(0.2)
    for plot in start.placement.plots:
        for t in alive(plot):
            for space in (plot.domain, plot.image):
                (ux, uy), (vx, vy) = space[plot.triangles[t, 1:]] - space[plot.triangles[t, 0]]
                assert ux * vy - uy * vx > 0
            for k in range(3):
                beyond = plot.neighbors[t, k]
                if beyond != NOBODY:
                    edge = {plot.triangles[t, k], plot.triangles[t, (k + 1) % 3]}
                    assert edge <= set(plot.triangles[beyond])
                    assert t in plot.neighbors[beyond]
        for v in whole_vertices(plot):
            assert v in plot.triangles[plot.at_vertex[v]]


def test_a_point_on_a_border_or_beyond_it_is_refused() -> None:
    start = garden("quadrants", 20)
    (plot,) = start.placement.plots
    v = plot.counts[VERTICES]
    before = triangle_keys(plot)
    for place in (start.foundation.samples.domain[40], np.array([-3.0, 5.0])):
        plot.domain[v] = plot.image[v] = place
        assert all(insert(plot, v, t, plot.holes) == 0 for t in alive(plot)[::25])
    assert triangle_keys(plot) == before
