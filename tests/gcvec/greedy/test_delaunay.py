"""The mesh that grows point by point is the one that is made of all points at once."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.greedy.delaunay import insert, remove
from gcvec.greedy.strip import NOBODY, VERTICES, Strip
from gcvec.patches.mesh import jitter
from gcvec.patches.triangulation import constrained_delaunay
from tests.gcvec.greedy.gardens import alive, garden, triangle_keys, whole_vertices
from tests.gcvec.scenes import some_points


def put(strip: Strip, pixel: np.ndarray, place: np.ndarray) -> bool:
    """Put a control point of a pixel at a place of the image into the strip.

    The walk to it begins anywhere: no frozen edge may be in its way.
    """
    v = strip.counts[VERTICES]
    strip.domain[v] = jitter(pixel[None])[0]
    strip.image[v], strip.color[v], strip.seat[v] = place, 0.5, 0
    for start in np.random.default_rng(v).permutation(alive(strip)):
        if insert(strip, v, start):
            strip.counts[VERTICES] += 1
            strip.whole[v] = True
            return True
    return False


def keys_of_mesh(vertices: np.ndarray, triangles: np.ndarray) -> set[frozenset[tuple[float, float]]]:
    return {frozenset((float(x), float(y)) for x, y in vertices[t]) for t in triangles}


@pytest.mark.parametrize("scene", ["ring", "quadrants", "voronoi"])
def test_points_put_in_and_taken_out_again(scene: str) -> None:
    start = garden(scene, 150)
    (strip,) = start.placement.strips
    before = triangle_keys(strip)
    assert before == keys_of_mesh(start.canvas.mesh.vertices, start.canvas.mesh.triangles)

    known = {tuple(p) for p in start.points.tolist()}
    more = [p for p in some_points(start.foundation, 120, seed=9) if tuple(p) not in known]
    places = start.foundation.geometry.to_image(jitter(np.array(more)))
    first = int(strip.counts[VERTICES])
    kept = [p for p, place in zip(more, places, strict=True) if put(strip, p, place)]
    assert len(kept) > 0.9 * len(more)

    # All at once gives the very same triangles.
    mesh, samples = start.canvas.mesh, start.foundation.samples
    sites = np.concatenate([mesh.vertices, jitter(np.array(kept))])
    triangles, _ = constrained_delaunay(sites, samples.segments)
    assert triangle_keys(strip) == keys_of_mesh(sites, triangles)

    for v in np.random.default_rng(1).permutation(np.arange(first, strip.counts[VERTICES])):
        assert remove(strip, v)
    assert triangle_keys(strip) == before


def test_neighbours_agree_and_nothing_folds() -> None:
    start = garden("voronoi", 80)
    start.placement.grow(0.3 * start.placement.error, 400)
    start.placement.thin_out(0.2)
    for strip in start.placement.strips:
        for t in alive(strip):
            for space in (strip.domain, strip.image):
                (ux, uy), (vx, vy) = space[strip.triangles[t, 1:]] - space[strip.triangles[t, 0]]
                assert ux * vy - uy * vx > 0
            for k in range(3):
                beyond = strip.neighbors[t, k]
                if beyond != NOBODY:
                    edge = {strip.triangles[t, k], strip.triangles[t, (k + 1) % 3]}
                    assert edge <= set(strip.triangles[beyond])
                    assert t in strip.neighbors[beyond]
        for v in whole_vertices(strip):
            assert v in strip.triangles[strip.at_vertex[v]]


def test_a_point_on_a_border_or_beyond_it_is_refused() -> None:
    start = garden("quadrants", 20)
    (strip,) = start.placement.strips
    v = strip.counts[VERTICES]
    before = triangle_keys(strip)
    for place in (start.foundation.samples.domain[40], np.array([-3.0, 5.0])):
        strip.domain[v] = strip.image[v] = place
        assert all(insert(strip, v, t) == 0 for t in alive(strip)[::25])
    assert triangle_keys(strip) == before
