"""Which rounds there are, seen from the pictures that come of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from skimage import data

from gcvec import Annotations, Options, Shape, VectorImage, vectorize
from gcvec.options import MOST_EFFORT
from gcvec.refinement.batch import EFFORTS
from gcvec.refinement.landing import MOST_SCALE
from gcvec.refinement.rounding import Rounding
from tests.gcvec.scenes import noise


def clouds(height: int, width: int, blur: float) -> np.ndarray:
    """Noise so blurred that a few points show most of it."""
    rng = np.random.default_rng(1)
    channels = [gaussian_filter(rng.normal(size=(height, width)), blur) for _ in range(3)]
    return np.stack([np.clip(128 + 60 * c / c.std(), 0, 255) for c in channels], axis=-1).astype(np.uint8)


def points(image: VectorImage) -> int:
    assert image.report is not None
    return image.report.points


@pytest.mark.parametrize("target", [20.0, 5.0, 1.0])
@pytest.mark.parametrize("blur", [10.0, 20.0, 30.0])
def test_smooth_pictures_come_to_their_targets(blur: float, target: float) -> None:
    image = vectorize(clouds(160, 240, blur), None, Options(target_mse=target, regions=1, max_points=0))
    assert image.warnings == ()
    assert image.report is not None
    assert image.report.mse <= target


def test_no_point_is_placed_where_colours_along_the_frame_do() -> None:
    """Of a ramp the first colours are off by more than the target, and those that have converged by less."""
    y, x = np.mgrid[:200, :300]
    ramp = np.stack([0.85 * x, 1.2 * y, (x + y) / 2], axis=-1).astype(np.uint8)
    for target in (20, 5, 1):
        image = vectorize(ramp, None, Options(target_mse=target, regions=1))
        assert points(image) == 0
        assert image.report is not None
        assert image.report.mse <= target


def test_points_that_buy_nothing_are_given_back_region_by_region() -> None:
    """No points help against hard noise, and its region may have many; the clouds beside it keep theirs."""
    pixels = clouds(80, 160, 10)
    pixels[:, 80:] = noise(80, 80)
    left, right = np.zeros((80, 160), bool), np.zeros((80, 160), bool)
    left[:, :80] = right[:, 80:] = True
    drawn = Annotations((Shape("clouds", mask=left), Shape("noise", mask=right)))
    image = vectorize(pixels, drawn, Options(target_mse=5, max_points=1500, snap=0))
    assert image.report is not None
    smooth, hard = image.report.regions
    assert smooth.mse < 8
    assert smooth.points > 100
    assert hard.points < 600


def test_steps_are_larger_where_points_are_cheap_though_some_regions_lack_a_few() -> None:
    """Larger than the last rounding of the planned ones could make them."""
    pixels = np.ascontiguousarray(data.rocket()[:200, :200])
    image = vectorize(pixels, None, Options(target_mse=5, max_points=800, regions=20))
    planned = Rounding(5).steps(len(image.colors) / (image.width * image.height))
    assert image.quantization.point_step > MOST_SCALE * planned.point_step
    assert image.warnings == ()


def test_gray_pictures_take_larger_steps() -> None:
    """What rounding adds to one axis of colour it does not add to the others."""
    gray = vectorize(np.repeat(clouds(80, 120, 4)[..., :1], 3, axis=2), None, Options(target_mse=1))
    colored = vectorize(clouds(80, 120, 4), None, Options(target_mse=1))
    assert gray.quantization.point_step > 1.4 * colored.quantization.point_step
    assert gray.report is not None
    assert gray.report.mse <= 1


def test_there_is_something_to_do_at_every_effort() -> None:
    assert list(EFFORTS) == list(range(1, MOST_EFFORT + 1))
