"""Parts against the whole that they are cut out of."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.parts.division import CELL, divided, part_of
from gcvec.patches.canonical import Canvas, Foundation, lay_canvas, lay_foundation
from tests.gcvec.parts.made import wide
from tests.gcvec.scenes import SCENES, foundation_of, needle, some_points


def scene(name: str) -> Foundation:
    return wide() if name == "wide" else foundation_of(name)


NAMES = ["wide", "voronoi", "ring", "stripes", "nested", "wheel", "diagonal"]


def triangles(canvas: Canvas, patches: np.ndarray) -> set[frozenset[tuple[float, float]]]:
    """The triangles of these patches by their corners in the whole picture's domain."""
    mesh, origin = canvas.mesh, canvas.foundation.network.origin or (0, 0)
    own = mesh.vertices[mesh.triangles[np.isin(mesh.patch, patches)]] + np.array(origin)
    return {frozenset((x, y) for x, y in corners) for corners in np.round(own, 9).tolist()}


@pytest.mark.parametrize("name", NAMES)
def test_every_patch_is_in_one_part(name: str) -> None:
    foundation = scene(name)
    n = len(foundation.network.loops)
    for parts in (1, 2, 3, n, n + 5):
        groups = divided(foundation, parts)
        assert len(groups) <= min(parts, n)
        assert sorted(np.concatenate(groups).tolist()) == list(range(n))


def test_a_patch_without_pixels_is_in_a_part_too() -> None:
    assert len(np.unique(needle().geometry.patch_at())) == 2
    for parts in (1, 2, 3):
        assert sorted(np.concatenate(divided(needle(), parts)).tolist()) == [0, 1, 2]


def test_parts_have_about_as_many_pixels() -> None:
    area = np.bincount(wide().geometry.patch_at().ravel())
    shares = [area[group].sum() for group in divided(wide(), 4)]
    assert max(shares) - min(shares) <= 2 * area.max()


@pytest.mark.parametrize("name", NAMES)
def test_a_part_has_the_mesh_that_the_whole_has_there(name: str) -> None:
    """The same free points, the same jitter, the same triangles, but for ties among boundary samples."""
    foundation = scene(name)
    points = some_points(foundation, 400)
    whole = lay_canvas(foundation, points)
    patch_at = foundation.geometry.patch_at()
    for group in divided(foundation, 3):
        part = part_of(foundation, group)
        assert (part.origin % CELL == 0).all()
        own = points[np.isin(patch_at[points[:, 1], points[:, 0]], group)]
        canvas = lay_canvas(lay_foundation(part.network, part.hard), own - part.origin)
        mine, its = triangles(canvas, np.arange(len(group))), triangles(whole, group)
        assert len(mine) == len(its)
        assert len(mine - its) <= 0.02 * len(its)
        assert set(canvas.mesh.patch.tolist()) <= set(range(len(group)))


@pytest.mark.parametrize("name", NAMES)
def test_what_parts_give_adds_up_to_the_picture(name: str) -> None:
    """With the whole picture's colours in each of them, and polylines that may follow borders less closely
    where that would fold a triangle over on the other side."""
    foundation = scene(name)
    network, space = foundation.network, foundation.space
    colors = np.random.default_rng(0).uniform(0, 1, (space.size, 3))
    total = np.zeros((network.height, network.width, 3))
    for group in divided(foundation, 3):
        part = part_of(foundation, group)
        (x, y), own = part.origin, part.network
        total[y : y + own.height, x : x + own.width] += drawn(
            lay_foundation(own, part.hard).bare_canvas, colors[part.colors]
        )
    off = np.abs(total - drawn(foundation.bare_canvas, colors)).max(axis=2)
    assert off.max() < 0.05
    assert (off > 1e-6).mean() < 0.03


def drawn(canvas: Canvas, colors: np.ndarray) -> np.ndarray:
    drawing, operator, corner = canvas.unit
    design = canvas.coverage(drawing).matrix(corner, operator.shape[0])
    network = canvas.foundation.network
    return np.asarray(design @ (operator @ colors)).reshape(network.height, network.width, 3)


def test_scenes_have_parts_within_parts() -> None:
    """A disc and what is around it: one part lies in a hole of the other."""
    assert "ring" in SCENES
    inner, outer = part_of(foundation_of("ring"), [2]), part_of(foundation_of("ring"), [0])
    assert len(inner.network.loops) == len(outer.network.loops) == 1
    assert inner.network.width <= outer.network.width
