"""The paper's own refinement loop, against the whole picture, dense algebra, and beside the batches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy import sparse

from gcvec import Annotations, Options, Progress, Shape, VectorImage, raster, vectorize
from gcvec.patches.canonical import Canvas, Foundation, lay_canvas
from gcvec.patches.mesh import build_mesh
from gcvec.refinement import paper
from gcvec.refinement.clearance import find_clear_pixels
from gcvec.refinement.paper import (
    WEIGHT,
    _Refinement,
    at_pixel_centres,
    domain_pixels,
    fitted_colors,
    region_canvas,
    turns_over,
    worst_pixels,
)
from gcvec.refinement.rounding import Rounding
from gcvec.refinement.scene import Iteration, Scene, Terms
from gcvec.timing import StageClock

WIDTH, HEIGHT = 72, 56


@dataclass(frozen=True)
class Case:
    pixels: np.ndarray
    annotations: Annotations


@cache
def case() -> Case:
    """Soft waves with a rectangle in them, whose border runs along pixel edges: no pixel is mixed."""
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    wave = 24 * np.sin(x / 7) * np.cos(y / 9)
    waves = np.stack([70 + x, 90 + y + wave, 150 + wave], axis=-1)
    bump = 60 * np.exp(-((x - 34) ** 2 + (y - 26) ** 2) / 60)
    box = np.stack([220 - x, 60 + y + bump, 50 + bump], axis=-1)
    inside = ((x > 20) & (x < 52) & (y > 12) & (y < 44))[..., None]
    ring = np.array([[20.0, 12.0], [52.0, 12.0], [52.0, 44.0], [20.0, 44.0]])
    pixels = np.rint(np.where(inside, box, waves)).astype(np.uint8)
    return Case(pixels, Annotations((Shape("box", rings=(ring,)),), WIDTH, HEIGHT))


@cache
def run(strategy: str, target_mse: float = 5.0, max_points: int = 2000) -> tuple[VectorImage, list[Progress]]:
    steps: list[Progress] = []
    options = Options(strategy=strategy, target_mse=target_mse, max_points=max_points)
    return vectorize(case().pixels, case().annotations, options, on_progress=steps.append), steps


def colors_at_centres(canvas: Canvas, colors: np.ndarray) -> np.ndarray:
    drawing = canvas.drawing()
    operator, corner_color = canvas.operator(drawing)
    picture = raster.sample(drawing.image, drawing.triangles, operator @ colors, corner_color, WIDTH, HEIGHT)
    return picture.reshape(-1, 3)


def start() -> tuple[Foundation, np.ndarray]:
    """Foundation and boundary colours of the picture without points."""
    image, _ = run("paper", target_mse=60000.0)
    assert not len(image.points)
    return image.foundation, image.boundary_colors


def refined(target_mse: float, max_points: int = 0) -> tuple[np.ndarray, np.ndarray, list[Iteration]]:
    foundation, boundary_colors = start()
    made: list[Iteration] = []
    scene = Scene(case().pixels, foundation, boundary_colors)
    terms = Terms(target_mse, max_points)
    points, colors = worst_pixels(scene, terms, made.append, StageClock())
    return points, colors, made


def test_without_points_both_strategies_start_from_the_same_patch() -> None:
    foundation, boundary_colors = start()
    none = np.zeros((0, 2), np.int64)
    whole = colors_at_centres(lay_canvas(foundation, none), boundary_colors)
    mesh = build_mesh(foundation.network, foundation.samples, none)
    seen = 0
    for region in range(len(foundation.network.loops)):
        pixel, matrix = at_pixel_centres(region_canvas(foundation, mesh, region))
        np.testing.assert_allclose(matrix @ boundary_colors, whole[pixel], rtol=0, atol=1e-14)
        seen += len(pixel)
    assert seen == WIDTH * HEIGHT
    batch, _ = run("batch", target_mse=60000.0)
    assert not len(batch.points)
    for ours, theirs in zip(foundation.network.curves, batch.network.curves, strict=True):
        assert np.array_equal(ours.control_points, theirs.control_points)
    assert np.array_equal(
        batch.canvas.blend.boundary.toarray(), lay_canvas(foundation, none).blend.boundary.toarray()
    )


def test_region_by_region_equals_the_whole_picture() -> None:
    foundation, _ = start()
    points, colors, _ = refined(20.0)
    canvas = lay_canvas(foundation, points)
    whole = colors_at_centres(canvas, colors)
    mesh = build_mesh(foundation.network, foundation.samples, points)
    n_boundary = foundation.space.size
    of_point = np.zeros(len(mesh.vertices), np.int64)
    of_point[mesh.triangles] = mesh.patch[:, None]
    of_point = of_point[mesh.n_samples : mesh.first_free]
    for region in range(len(foundation.network.loops)):
        pixel, matrix = at_pixel_centres(region_canvas(foundation, mesh, region))
        own = np.concatenate([colors[:n_boundary], colors[n_boundary:][of_point == region]])
        np.testing.assert_allclose(matrix @ own, whole[pixel], rtol=0, atol=1e-12)


def test_the_first_point_is_the_worst_pixel_that_can_be_one() -> None:
    foundation, boundary_colors = start()
    points, _, _ = refined(5.0, max_points=1)
    assert len(points) == len(foundation.network.loops)
    before = colors_at_centres(lay_canvas(foundation, np.zeros((0, 2), np.int64)), boundary_colors)
    square = ((before - case().pixels.reshape(-1, 3) / 255) ** 2).sum(axis=1).reshape(HEIGHT, WIDTH)
    owner, domain = foundation.geometry.patch_at(), domain_pixels(foundation).reshape(HEIGHT, WIDTH, 2)
    for point in points:
        region = owner[point[1], point[0]]
        for pixel in np.argsort(-np.where(owner == region, square, -1), axis=None):
            y, x = np.divmod(pixel, WIDTH)
            if can_be_a_point(foundation, domain[y, x], region):
                break
        as_bad = domain[(owner == region) & np.isclose(square, square[y, x], rtol=1e-9)]
        assert point.tolist() in as_bad.tolist()


def can_be_a_point(foundation: Foundation, place: np.ndarray, region: int) -> bool:
    x, y = place
    if x < 0 or not find_clear_pixels(foundation)[y, x] or foundation.geometry.patch_at()[y, x] != region:
        return False
    return not turns_over(foundation, build_mesh(foundation.network, foundation.samples, place[None]))


def test_every_iteration_adds_one_point_and_reports_once() -> None:
    points, _, made = refined(20.0)
    assert [one.number for one in made] == list(range(1, len(points) + 1))
    assert [one.points for one in made] == list(range(1, len(points) + 1))
    assert made[-1].mse < 20.0 < made[0].mse
    image, progress = run("paper")
    assert image.report is not None
    assert sum(p.phase == "refine" for p in progress) == image.report.points


def test_fit_is_equation_7() -> None:
    rng = np.random.default_rng(1)
    matrix = rng.random((60, 9))
    boundary, truth, wanted = rng.random((4, 3)), 2 * rng.random((60, 3)), rng.random((5, 3))
    beyond = truth - matrix[:, :4] @ boundary
    stacked = np.concatenate([matrix[:, 4:], np.sqrt(WEIGHT) * np.eye(5)])
    dense = np.linalg.lstsq(stacked, np.concatenate([beyond, np.sqrt(WEIGHT) * wanted]), rcond=None)[0]
    fitted = fitted_colors(sparse.csr_array(matrix), boundary, truth, wanted)
    np.testing.assert_allclose(fitted, np.clip(dense, 0, 1), atol=1e-12)


def test_max_points_bounds_a_region() -> None:
    points, _, _ = refined(0.5, max_points=7)
    assert len(points) == 7 * len(start()[0].network.loops)


def test_nothing_folds() -> None:
    foundation, _ = start()
    points, _, _ = refined(5.0)
    assert not turns_over(foundation, build_mesh(foundation.network, foundation.samples, points))
    image, _ = run("paper")
    assert image.foldovers == 0


@pytest.mark.parametrize("strategy", ["batch", "paper"])
def test_both_reach_the_target_and_say_what_it_cost(strategy: str) -> None:
    image, _ = run(strategy)
    report = image.report
    assert report is not None
    density = len(image.colors) / (image.width * image.height)
    rounding = 1.5 * Rounding(5.0).cost(image.quantization, density)  # what the file's steps may add
    assert (report.mse_raw if strategy == "paper" else report.mse) < 5.0 + rounding
    assert report.strategy == strategy
    assert report.points == len(image.points) > 0
    assert report.seconds["total"] > 0
    assert {"mesh_harmonic", "evaluation", "optimization"} <= report.seconds.keys()


def beginning() -> _Refinement:
    """The loop's state before the first point, its pixels measured."""
    foundation, boundary_colors = start()
    state = _Refinement(Scene(case().pixels, foundation, boundary_colors), StageClock())
    for region in range(len(foundation.network.loops)):
        state.evaluate(region, build_mesh(foundation.network, foundation.samples, state.points))
    return state


def able(state: _Refinement, region: int) -> np.ndarray:
    """Pixels of a region, row by row, that can become control points if nothing folds."""
    x, y = state.domain_pixel.T
    return np.flatnonzero(
        (state.owner == region) & (x >= 0) & state.usable[y, x] & (state.patch_at[y, x] == region)
    )


def test_of_equally_bad_pixels_the_first_becomes_a_point() -> None:
    state = beginning()
    state.error[:] = 0.1
    for k in range(3):
        first = able(state, 1)[0]
        assert state.insert_worst(1) is not None
        np.testing.assert_array_equal(state.points[k], state.domain_pixel[first])
        np.testing.assert_array_equal(state.wanted[k], state.truth[first])
    assert state.of_region.tolist() == [1, 1, 1]


def test_a_point_goes_where_no_other_is() -> None:
    """However bad its pixel still is."""
    state = beginning()
    state.error[:] = 0.1
    worst = able(state, 0)[100]
    state.error[worst] = 0.5
    state.insert_worst(0)
    state.insert_worst(0)
    np.testing.assert_array_equal(state.points[0], state.domain_pixel[worst])
    assert len(np.unique(state.points, axis=0)) == 2


def test_a_point_that_would_fold_is_passed_over_for_good(monkeypatch: pytest.MonkeyPatch) -> None:
    state = beginning()
    first, second, third = np.argsort(-(state.error[able(state, 0)] ** 2).sum(axis=1), kind="stable")[:3]
    wanted = state.domain_pixel[able(state, 0)[[first, second, third]]]
    folds = [True]
    monkeypatch.setattr(paper, "turns_over", lambda *_: bool(folds) and folds.pop())
    for _ in range(2):
        assert state.insert_worst(0) is not None
    np.testing.assert_array_equal(state.points, wanted[1:])


def test_where_no_pixel_can_be_a_point_there_is_none() -> None:
    state = beginning()
    state.usable[:] = False
    assert state.insert_worst(0) is None
    assert len(state.points) == 0


def test_the_last_of_a_region_that_can_be_a_point_becomes_one() -> None:
    state = beginning()
    last = state.domain_pixel[able(state, 1)[-1]]
    state.usable[:] = False
    state.usable[last[1], last[0]] = True
    assert state.insert_worst(0) is None
    assert state.insert_worst(1) is not None
    np.testing.assert_array_equal(state.points, last[None])
    assert (state.count(0), state.count(1)) == (0, 1)


def test_errors_are_told_of_regions_and_of_the_picture() -> None:
    state = beginning()
    state.error[:] = np.where(state.owner == 1, 0.2, 0.1)[:, None]
    state.error[7, 1] = -0.9
    assert state.mse(1) == pytest.approx(0.04 * 65025)
    assert state.mse() == pytest.approx((state.error**2).mean() * 65025)
    assert state.worst() == pytest.approx(0.9 * 255)
    assert state.mse(99) == 0.0
