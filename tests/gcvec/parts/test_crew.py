"""Pictures made in parts against those made in one go."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from skimage import data

from gcvec import Annotations, Options, Progress, Shape, VectorImage, vectorize
from gcvec.parts.crew import Crew
from gcvec.parts.messages import (
    PartRequest,
    PartResult,
    request_bytes,
    request_from,
    result_bytes,
    result_from,
)
from gcvec.parts.part import refine_part
from tests.gcvec.crews import Alone
from tests.gcvec.scenes import SCENES, Scene, voronoi
from tests.gcvec.soundness import assert_sound


@dataclass(frozen=True)
class Helpers:
    """A crew that gets bytes, does the last first and hands bytes back."""

    parts: int

    def __call__(self, requests: Sequence[PartRequest], pixels: np.ndarray) -> Iterator[PartResult]:
        for request in reversed(requests):
            received = request_from(request_bytes(request))
            yield result_from(result_bytes(refine_part(received, pixels, lambda _: None)))


def made(
    pixels: np.ndarray, annotations: Annotations | None, crew: Crew | None, **options: int
) -> VectorImage:
    settings = Options(max_points=options.pop("max_points", 0), workers=1, **options)
    image = vectorize(pixels, annotations, settings, None, crew)
    assert_sound(image, pixels)
    return image


def noisy(scene: Scene) -> np.ndarray:
    """Its picture, the right half of it with a texture."""
    pixels = scene.picture().astype(float)
    texture = np.random.default_rng(0).normal(0, 6, pixels.shape)
    texture[:, : scene.width // 2] = 0
    return np.clip(pixels + texture, 0, 255).astype(np.uint8)


def assert_near(parts: VectorImage, whole: VectorImage, bytes_more: float) -> None:
    assert parts.report is not None
    assert whole.report is not None
    assert parts.report.mse <= 5
    assert parts.report.foldovers == 0
    assert parts.report.patches == whole.report.patches
    assert parts.report.bytes <= (1 + bytes_more) * whole.report.bytes


def test_a_scene_takes_hardly_more_bytes_in_parts() -> None:
    scene = voronoi(160, 200, 30, 9)
    pixels, annotations = noisy(scene), scene.annotations()
    assert_near(made(pixels, annotations, Alone(4)), made(pixels, annotations, None), 0.05)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["coffee", "astronaut"])
def test_a_photo_takes_hardly_more_bytes_in_parts(name: str) -> None:
    pixels = np.ascontiguousarray(getattr(data, name)()[60:360, 100:400])
    parts, whole = (made(pixels, None, crew, regions=60) for crew in (Alone(4), None))
    assert_near(parts, whole, 0.05)


def test_it_does_not_matter_who_does_what_and_when() -> None:
    scene = voronoi(120, 160, 20, 2)
    pixels, annotations = noisy(scene), scene.annotations()
    one, other = (made(pixels, annotations, crew) for crew in (Alone(3), Helpers(3)))
    assert one.to_bytes() == other.to_bytes()


@pytest.mark.parametrize("scene", SCENES)
def test_made_scenes_in_more_parts_than_they_have_regions(scene: str) -> None:
    """Single regions, regions in holes of others, regions a pixel or two wide."""
    image = made(SCENES[scene].picture(), SCENES[scene].annotations(), Alone(50))
    assert image.report is not None
    if scene not in ("diagonal", "stripes"):
        assert image.report.mse <= 5


def test_regions_of_three_pixels() -> None:
    labels = np.zeros((40, 60), np.int32)
    for k in range(12):
        labels[3 * k + 2, 5 * (k % 6) + 4 : 5 * (k % 6) + 7] = k + 1
    scene = Scene(40, 60, lambda x, y: labels[y.astype(int), x.astype(int)])
    shapes = tuple(Shape(str(k), mask=labels == k, offset=(0, 0)) for k in range(13) if (labels == k).any())
    made(noisy(scene), Annotations(shapes), Alone(6))


def test_one_region_has_no_parts() -> None:
    scene = Scene(40, 60, lambda x, y: 0 * x.astype(int))
    pixels, annotations = noisy(scene), scene.annotations()
    one, other = (made(pixels, annotations, crew) for crew in (Helpers(4), None))
    assert one.to_bytes() == other.to_bytes()


def test_a_bound_on_points_holds_in_every_region() -> None:
    scene = voronoi(120, 160, 8, 2)
    image = made(noisy(scene), scene.annotations(), Alone(3), max_points=60)
    assert image.report is not None
    assert max(region.points for region in image.report.regions) <= 60


def test_progress_never_falls() -> None:
    scene = voronoi(120, 160, 20, 2)
    told: list[Progress] = []
    image = vectorize(noisy(scene), scene.annotations(), Options(max_points=0), told.append, Alone(3))
    fractions = [p.fraction for p in told]
    assert fractions == sorted(fractions)
    rounds = [p for p in told if p.phase == "refine"]
    assert [p.iteration for p in rounds] == list(range(1, len(rounds) + 1))
    assert told[-1].points == len(image.points)
    assert image.report is not None
    assert image.report.seconds["parts"] > 0
