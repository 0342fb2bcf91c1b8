"""Floods against scikit-image's, and where values are equal."""

from __future__ import annotations

import numpy as np
import pytest
from skimage import measure, morphology
from skimage.segmentation import watershed

from gcvec.regions.watershed import flooded, minima


@pytest.mark.parametrize("shape", [(1, 1), (1, 30), (30, 1), (40, 50)])
def test_floods_equal_scikit_images(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(7)
    values = rng.random(shape).astype(np.float32)
    seeds = np.where(rng.random(shape) < 0.05, rng.integers(1, 9, shape), 0).astype(np.int32)
    seeds[0, 0] = 1
    np.testing.assert_array_equal(flooded(values, seeds), watershed(values, seeds, connectivity=1))


def test_floods_of_one_level_meet_half_way() -> None:
    seeds = np.zeros((3, 12), np.int32)
    seeds[1, 0], seeds[1, 11] = 1, 2
    labels = flooded(np.zeros((3, 12)), seeds)
    np.testing.assert_array_equal(labels, np.repeat([[1, 2]], [6, 6], axis=1).repeat(3, axis=0))


def test_seeds_are_not_changed() -> None:
    seeds = np.array([[1, 0, 2]], np.int32)
    flooded(np.zeros((1, 3)), seeds)
    np.testing.assert_array_equal(seeds, [[1, 0, 2]])


@pytest.mark.parametrize("levels", [3, 1000])
def test_minima_equal_scikit_images(levels: int) -> None:
    values = np.random.default_rng(levels).integers(0, levels, (40, 50)).astype(np.float32)
    expected = measure.label(morphology.local_minima(values, connectivity=1), connectivity=1)
    np.testing.assert_array_equal(minima(values), expected)


def test_a_flat_picture_is_one_minimum() -> None:
    np.testing.assert_array_equal(minima(np.zeros((3, 4))), np.ones((3, 4)))
