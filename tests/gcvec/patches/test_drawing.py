"""Fans along curves against triangles cut one edge after the other; folded triangles."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from skimage import data

from gcvec import Options, vectorize
from gcvec.patches.canonical import lay_canvas
from gcvec.patches.drawing import folded
from gcvec.patches.fans import fans
from gcvec.patches.segment_table import segment_table
from tests.gcvec.areas import areas
from tests.gcvec.scenes import SCENES, foundation_of, some_points

Triangle = tuple[int, int, int]


def cut(triangle: Triangle, points: dict[tuple[int, int], list[int]]) -> list[Triangle]:
    """A triangle cut along its first edge that has points on it, and so on with what comes out."""
    for k in range(3):
        a, b, apex = triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]
        if between := points.get((a, b)):
            along = [a, *between, b]
            return [t for s, e in zip(along, along[1:], strict=False) for t in cut((s, e, apex), points)]
    return [triangle]


@pytest.mark.parametrize(
    "count", [[2, 0, 0], [0, 3, 0], [1, 2, 0], [0, 1, 1], [2, 0, 4], [1, 1, 1], [3, 2, 5]]
)
@pytest.mark.parametrize("flip", [False, True])
def test_a_triangle_becomes_fans(count: list[int], flip: bool) -> None:
    segments = np.array([[1, 0], [1, 2], [0, 2]] if flip else [[0, 1], [1, 2], [2, 0]])
    first = 10 + np.cumsum(count) - count
    points = {}
    for (a, b), start, n in zip(segments.tolist(), first.tolist(), count, strict=True):
        points[a, b] = list(range(start, start + n))
        points[b, a] = points[a, b][::-1]
    triangles = np.array([[3, 4, 5], [0, 1, 2]])
    found, owner = fans(triangles, segment_table(segments, 3), first, np.array(count))
    assert found.tolist() == [list(t) for t in cut((0, 1, 2), points)]
    assert (owner == 1).all()


def test_without_points_between_nothing_is_cut() -> None:
    segments, none = np.array([[0, 1]]), np.zeros(1, np.int64)
    found, owner = fans(np.array([[0, 1, 2]]), segment_table(segments, 3), none + 3, none)
    assert len(found) == len(owner) == 0


@pytest.mark.parametrize("scene", SCENES)
def test_drawings_are_whole_at_every_scale(scene: str) -> None:
    """Both sides of a curve share its points: areas stay whole and each inner edge has two triangles."""
    foundation = foundation_of(scene)
    canvas = lay_canvas(foundation, some_points(foundation, 15))
    network = foundation.network
    for flatness in (np.inf, 0.1, 0.002):
        drawing = canvas.drawing(flatness)
        assert areas(drawing.image, drawing.triangles).sum() == pytest.approx(network.width * network.height)
        edges = np.sort(drawing.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        unique, times = np.unique(edges, axis=0, return_counts=True)
        assert times.max() == 2
        ends = drawing.image[unique[times == 1]]
        on_frame = np.isclose(ends, 0) | np.isclose(ends, [network.width, network.height])
        assert on_frame.all(axis=1).any(axis=1).all()
        assert (areas(drawing.image, drawing.triangles) > 0).all()


def test_triangles_that_turn_over_are_found() -> None:
    rng = np.random.default_rng(0)
    image, triangles = (
        rng.uniform(0, 9, (20, 2)),
        rng.permuted(np.tile(np.arange(20), (50, 1)), axis=1)[:, :3],
    )
    np.testing.assert_array_equal(folded(image, triangles), np.flatnonzero(areas(image, triangles) <= 0))
    assert folded(image, np.array([[0, 1, 1], [0, 1, 2], [0, 2, 1]])).tolist() in ([0, 1], [0, 2])


def test_colours_between_samples_are_in_proportion() -> None:
    foundation = foundation_of("ring")
    canvas = lay_canvas(foundation, some_points(foundation, 15))
    drawing = canvas.drawing(0.001)
    operator, color = canvas.operator(drawing)
    colors = operator @ np.random.default_rng(0).random(operator.shape[1])
    found = {
        (int(v), int(p)): colors[c]
        for corners, p, cs in zip(drawing.triangles, drawing.patch, color, strict=True)
        for v, c in zip(corners, cs, strict=True)
    }
    n_vertices, checked = len(canvas.mesh.vertices), 0
    for (vertex, patch), value in found.items():
        if vertex < n_vertices:
            continue
        (start, end), along = drawing.ends[vertex - n_vertices].tolist(), drawing.along[vertex - n_vertices]
        ends = [found.get((sample, patch)) for sample in (start, end)]
        if None not in ends:
            assert value == pytest.approx((1 - along) * ends[0] + along * ends[1])
            checked += 1
    assert checked > 50


@pytest.mark.parametrize("name", ["chelsea", "astronaut"])
def test_a_photo_is_the_same_at_every_scale(name: str) -> None:
    """At borders too, where the colours along the curves change fast."""
    photo = np.asarray(Image.fromarray(getattr(data, name)()).resize((128, 128)))
    image = vectorize(photo, None, Options(max_points=0))
    once = image.render().astype(int)
    for scale in (2, 4, 8):
        finer = image.render(scale).reshape(128, scale, 128, scale, 3).mean(axis=(1, 3))
        assert np.abs(finer - once).max() <= 4
