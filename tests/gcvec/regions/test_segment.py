from __future__ import annotations

import numpy as np
import pytest
import skimage.data
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray
from scipy import ndimage

from gcvec.regions.components import SLIVER_AREA, connected_components
from gcvec.regions.segment import segment

Pixels = NDArray[np.uint8]
Labels = NDArray[np.int32]


def regions(pixels: Pixels, count: int = 0) -> Labels:
    result = segment(pixels, count)
    assert result.labels.shape == pixels.shape[:2]
    assert result.labels.dtype == np.int32
    assert result.names == ("region",) * (result.labels.max() + 1)
    assert result.warnings == ()
    np.testing.assert_array_equal(connected_components(result.labels), result.labels)
    return result.labels


def near_a_border(labels: Labels) -> NDArray[np.bool_]:
    """Pixels within one pixel of another label."""
    lowest, highest = ndimage.minimum_filter(labels, 3), ndimage.maximum_filter(labels, 3)
    return np.asarray(lowest != highest)


def assert_same_up_to_a_pixel(found: Labels, truth: Labels) -> None:
    away = ~near_a_border(truth)
    pairs = np.unique(np.stack([found[away], truth[away]]), axis=1)
    assert len(np.unique(pairs[0])) == len(np.unique(pairs[1])) == pairs.shape[1]
    assert found.max() == truth.max()


def shapes(height: int = 160, width: int = 240) -> Labels:
    """A disc with a hole that is a region, beside a triangle and on two halves."""
    y, x = np.mgrid[:height, :width]
    owners = np.where(x < width // 2, 0, 1)
    owners[np.hypot(x - 70, y - 80) < 50] = 2
    owners[np.hypot(x - 60, y - 85) < 20] = 3
    owners[(x > 150) & (y > 40) & (y - 40 < 1.5 * (x - 150)) & (x < 215)] = 4
    return connected_components(owners.astype(np.int32))


def coloured(labels: Labels, seed: int = 3) -> NDArray[np.float64]:
    """Every region in a colour of its own, neighbours at least 30 levels apart."""
    levels = 40 + 35.0 * np.arange(labels.max() + 1)
    colours = np.random.default_rng(seed).permuted(np.stack([levels] * 3, axis=1), axis=1)
    return colours[labels]


def pixels_of(colours: NDArray[np.float64]) -> Pixels:
    return np.clip(np.rint(colours), 0, 255).astype(np.uint8)


def test_flat_regions_are_found_to_the_pixel() -> None:
    truth = shapes()
    assert_same_up_to_a_pixel(regions(pixels_of(coloured(truth))), truth)


def test_blur_and_noise_do_not_move_borders() -> None:
    truth = shapes()
    blurred = ndimage.gaussian_filter(coloured(truth), (0.8, 0.8, 0))
    noisy = blurred + np.random.default_rng(0).normal(0, 3, blurred.shape)
    found = regions(pixels_of(noisy))
    assert found.max() == truth.max()
    both = np.unique(np.stack([found, truth])[:, ~ndimage.binary_dilation(near_a_border(truth))], axis=1)
    assert both.shape[1] == truth.max() + 1


@pytest.mark.parametrize("square", [16, 24, 32])
def test_every_square_of_a_chessboard_is_a_region(square: int) -> None:
    """Basins between four squares, a few pixels large, join none of them across the corner."""
    y, x = np.mgrid[: 8 * square, : 8 * square] // square
    dark = (x + y) % 2 == 0
    truth = connected_components(dark.astype(np.int32))
    assert truth.max() + 1 == 64
    assert_same_up_to_a_pixel(regions(pixels_of(np.where(dark, 40.0, 230.0)[..., None] + np.zeros(3))), truth)


def test_shaded_balls_are_one_region_each() -> None:
    y, x = np.mgrid[:200, :300]
    picture = np.stack([60 + x / 10, 70 + y / 10, np.full(x.shape, 90.0)], axis=-1)
    truth = np.zeros(x.shape, dtype=np.int32)
    for number, (cx, cy, radius) in enumerate([(80, 90, 60), (210, 120, 50)], start=1):
        height = np.sqrt(np.maximum(1 - ((x - cx) ** 2 + (y - cy) ** 2) / radius**2, 0))
        ball = np.hypot(x - cx, y - cy) < radius
        picture[ball] = (np.array([200, 120, 40]) + 50 * height[..., None])[ball]
        truth[ball] = number
    assert_same_up_to_a_pixel(regions(pixels_of(picture)), connected_components(truth))


@pytest.mark.parametrize("shape", [(1, 1), (1, 50), (50, 1), (2, 2), (120, 90)])
def test_what_is_flat_is_one_region(shape: tuple[int, int]) -> None:
    assert regions(np.full((*shape, 3), 77, dtype=np.uint8)).max() == 0
    assert regions(np.full((*shape, 3), 77, dtype=np.uint8), 5).max() == 0


def test_gradients_and_noise_hold_no_borders() -> None:
    y, x = np.mgrid[:200, :300]
    gradient = np.stack([x * 0.8, y * 1.2, (x + y) * 0.5], axis=-1)
    noise = np.random.default_rng(1)
    assert regions(pixels_of(gradient)).max() == 0
    assert regions(pixels_of(gradient + noise.normal(0, 4, gradient.shape))).max() == 0
    assert regions(pixels_of(128 + noise.normal(0, 20, gradient.shape))).max() == 0
    assert regions(noise.integers(0, 256, gradient.shape, dtype=np.uint8)).max() < 30


def test_as_many_regions_as_wanted() -> None:
    coffee = skimage.data.coffee()[::2, ::2]
    for count in (1, 2, 7, 100, 500):
        assert regions(coffee, count).max() + 1 == count


def test_no_region_is_a_sliver_however_many_are_wanted() -> None:
    coffee = skimage.data.coffee()[::4, ::4]
    for count in (0, 100, 2000, 10_000):
        assert np.bincount(regions(coffee, count).ravel()).min() >= SLIVER_AREA


def test_fewer_regions_are_unions_of_more() -> None:
    coffee = skimage.data.coffee()[::2, ::2]
    coarse, fine = regions(coffee, 10), regions(coffee, 60)
    assert np.unique(np.stack([coarse.ravel(), fine.ravel()]), axis=1).shape[1] == 60


def test_a_photo_ends_at_tens_of_regions_on_its_edges() -> None:
    coffee = skimage.data.coffee()
    labels = regions(coffee)
    assert 20 <= labels.max() + 1 <= 150
    assert np.bincount(labels.ravel()).min() >= 16
    steepness = ndimage.gaussian_gradient_magnitude(coffee.mean(axis=-1), 1)
    border = labels[:, 1:] != labels[:, :-1]
    assert np.median(steepness[:, 1:][border]) > 3 * np.median(steepness)


def test_the_same_picture_gives_the_same_regions() -> None:
    coffee = skimage.data.coffee()[100:300, 100:400]
    np.testing.assert_array_equal(regions(coffee), regions(coffee.copy()))


def test_a_large_picture_has_its_borders_at_full_resolution() -> None:
    truth = np.kron(shapes(), np.ones((8, 8), dtype=np.int32))
    assert truth.size > 2_000_000
    assert_same_up_to_a_pixel(regions(pixels_of(coloured(truth))), truth)


pictures = hnp.arrays(
    np.uint8,
    st.tuples(st.integers(1, 24), st.integers(1, 24), st.just(3)),
    elements=st.sampled_from([0, 10, 60, 200, 255]),
)


@given(pictures, st.integers(0, 12))
def test_any_picture_divides(pixels: Pixels, count: int) -> None:
    found = regions(pixels, count).max() + 1
    if count:
        assert found <= count


def test_no_region_has_much_more_than_the_most_it_may_hold() -> None:
    """Smooth noise without any region of its own: it is divided where it varies most."""
    rng = np.random.default_rng(5)
    pixels = pixels_of(128 + 60 * ndimage.gaussian_filter(rng.normal(0, 1, (120, 160, 3)), (3, 3, 0)))
    load = np.full((120, 160), 0.5)
    whole = segment(pixels, least_step=100)
    divided = segment(pixels, least_step=100, load=load, most_load=1200)
    assert len(whole.names) == 1
    assert 8 <= len(divided.names) <= 32
    assert np.bincount(divided.labels.ravel(), load.ravel()).max() <= 2 * 1200
