"""A picture that misses its target says so, and why."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from skimage import data

from gcvec import Annotations, Options, Progress, Shape, VectorImage, vectorize
from tests.gcvec.scenes import SCENES, noise

SENTENCE = re.compile(
    r"the mean squared error(?: at the centres of pixels)? stays at (\d+\.\d\d), "
    r"above the target of ([\d.]+): (.+)"
)


def faint_noise(side: int = 40) -> np.ndarray:
    return np.asarray(90 + noise(side, side) // 3)


def told(image: VectorImage) -> tuple[float, float, str]:
    """Error, target and reason of the only warning."""
    (warning,) = image.warnings
    found = SENTENCE.fullmatch(warning)
    assert found, warning
    return float(found[1]), float(found[2]), found[3]


@pytest.mark.parametrize("strategy", ["batch", "paper"])
def test_full_regions_are_counted(strategy: str) -> None:
    image = vectorize(
        faint_noise(), None, Options(strategy=strategy, target_mse=20, max_points=25, regions=1)
    )
    assert image.report is not None
    error = image.report.mse_raw if strategy == "paper" else image.report.mse
    assert told(image) == (
        pytest.approx(error, abs=0.006),
        20,
        "1 of 1 regions need more than the 25 control points that max_points allows",
    )


def test_regions_that_did_not_pay_for_the_points_they_may_have_are_counted_too() -> None:
    """They are left with fewer, but it is the bound that has kept them from the target."""
    pixels, options = noise(90, 90), Options(target_mse=3000, regions=1)
    bounded = vectorize(pixels, None, replace(options, max_points=500))
    free = vectorize(pixels, None, replace(options, max_points=0))
    assert free.report is not None
    assert free.report.mse <= 3000
    assert len(bounded.points) < 400
    assert told(bounded)[2] == "1 of 1 regions need more than the 500 control points that max_points allows"


def test_points_that_no_longer_help_are_named() -> None:
    image = vectorize(noise(24, 24), None, Options(target_mse=5, max_points=0))
    assert image.report is not None
    assert told(image) == (
        pytest.approx(image.report.mse, abs=0.006),
        5,
        "more control points no longer help",
    )


def test_the_warning_is_part_of_the_description() -> None:
    image = vectorize(faint_noise(24), None, Options(target_mse=20, max_points=5, regions=1))
    assert image.description()["warnings"] == list(image.warnings)


def test_a_picture_within_its_target_has_nothing_to_say() -> None:
    scene = SCENES["quadrants"]
    image = vectorize(scene.picture(), scene.annotations(), Options(target_mse=5))
    assert image.warnings == ()


def test_found_regions_are_as_many_as_hold_the_points_needed() -> None:
    """One cat needs more points than a region may have; several regions have them."""
    pixels = data.chelsea()[40:200, 100:300]
    few, many = (vectorize(pixels, None, Options(target_mse=20, max_points=n)) for n in (2000, 0))
    assert few.report is not None
    assert many.report is not None
    assert many.report.points > 2000
    assert max(region.points for region in few.report.regions) <= 2000
    assert few.report.mse <= 20
    assert few.warnings == ()


def test_a_file_that_cannot_grow_says_why() -> None:
    image = vectorize(faint_noise(), None, Options(target_bytes=20_000, max_points=25))
    (warning,) = image.warnings
    why = r"\d+ of \d+ regions need more than the 25 control points that max_points allows"
    assert re.fullmatch(rf"the file takes \d+ of 20000 bytes, no more: {why}", warning)


@pytest.mark.parametrize("sizes", [{"target_mse": 320}, {"target_bytes": 20_000}])
def test_a_full_region_is_counted_even_if_it_is_the_better_one(sizes: dict[str, float]) -> None:
    """Its points would make up for what others lack: the target is the picture's."""
    pixels = faint_noise()
    pixels[:, :5] = noise(40, 40)[:, :5]
    strip, rest = np.zeros((40, 40), bool), np.zeros((40, 40), bool)
    strip[:, :5] = rest[:, 5:] = True
    drawn = Annotations((Shape("strip", mask=strip), Shape("rest", mask=rest)))
    image = vectorize(pixels, drawn, Options(max_points=600, snap=0, **sizes))
    assert image.report is not None
    noisy, faint = image.report.regions
    assert noisy.points <= 200
    assert faint.points == 600
    assert faint.mse < 320 < image.report.mse < noisy.mse
    (warning,) = image.warnings
    assert warning.endswith("1 of 2 regions need more than the 600 control points that max_points allows")


@pytest.mark.parametrize("target_mse", [50, 60, 80])
def test_what_rounding_has_cost_is_not_laid_on_the_points(target_mse: float) -> None:
    reached: list[float] = []

    def watch(progress: Progress) -> None:
        if progress.phase == "refine" and progress.mse is not None:
            reached.append(progress.mse)

    options = Options(strategy="paper", target_mse=target_mse, max_points=0, regions=1)
    image = vectorize(faint_noise(16), None, options, on_progress=watch)
    assert reached[-1] < target_mse
    error, _, why = told(image)
    assert error > 1.15 * target_mse
    assert why == "rounding to the file's steps has cost the rest"
