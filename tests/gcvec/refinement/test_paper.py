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
from gcvec.quantization import Quantization
from gcvec.refinement.clearance import room
from gcvec.refinement.paper import (
    WEIGHT,
    at_pixel_centres,
    domain_pixels,
    fitted_colors,
    region_canvas,
    turns_over,
    worst_pixels,
)
from gcvec.refinement.scene import Scene, Step, Terms
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


def refined(target_mse: float, max_points: int = 0) -> tuple[np.ndarray, np.ndarray, list[Step]]:
    foundation, boundary_colors = start()
    steps: list[Step] = []
    scene = Scene(case().pixels, foundation, boundary_colors)
    terms = Terms(target_mse, Quantization(), max_points)
    points, colors = worst_pixels(scene, terms, steps.append, StageClock())
    return points, colors, steps


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
        np.testing.assert_array_equal(domain[y, x], point)


def can_be_a_point(foundation: Foundation, place: np.ndarray, region: int) -> bool:
    x, y = place
    if x < 0 or not room(foundation)[y, x] or foundation.geometry.patch_at()[y, x] != region:
        return False
    return not turns_over(foundation, build_mesh(foundation.network, foundation.samples, place[None]))


def test_every_iteration_adds_one_point_and_reports_once() -> None:
    points, _, steps = refined(20.0)
    assert [s.iteration for s in steps] == list(range(1, len(points) + 1))
    assert [s.points for s in steps] == list(range(1, len(points) + 1))
    assert steps[-1].mse < 20.0 < steps[0].mse
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
    steps = image.quantization
    rounding = ((255 * steps.point) ** 2 + (255 * steps.boundary) ** 2) / 12  # what the file's steps may add
    assert (report.mse_raw if strategy == "paper" else report.mse) < 5.0 + rounding
    assert report.strategy == strategy
    assert report.points == len(image.points) > 0
    assert report.seconds["total"] > 0
    assert {"mesh_harmonic", "evaluation", "optimization"} <= report.seconds.keys()
