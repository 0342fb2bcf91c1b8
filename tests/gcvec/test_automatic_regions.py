"""How many regions a picture is divided into by itself for a file of a given size."""

from __future__ import annotations

import numpy as np
import pytest
import skimage.data
from numpy.typing import NDArray

from gcvec import Options, VectorImage, vectorize
from gcvec.automatic_regions import automatic_regions

Pixels = NDArray[np.uint8]


def signs(rows: int = 2, columns: int = 3, pitch: int = 64) -> Pixels:
    """Rings of one colour around discs of another, in squares of a third, on white, anti-aliased."""
    random = np.random.default_rng(2)
    palette = [random.permuted([[20, 60, 150], [250, 200, 40], [110, 10, 30]], axis=1) for _ in range(99)]
    y, x = (np.mgrid[: rows * pitch * 4, : columns * pitch * 4] + 0.5) / 4
    fine = np.full((*x.shape, 3), 255.0)
    for k, (square, ring, disc) in enumerate(palette[: rows * columns]):
        dy, dx = y - (k // columns + 0.5) * pitch, x - (k % columns + 0.5) * pitch
        fine[np.maximum(abs(dy), abs(dx)) < 0.42 * pitch] = square
        fine[np.hypot(dy, dx) < 0.33 * pitch] = ring
        fine[np.hypot(dy, dx) < 0.18 * pitch] = disc
    return np.rint(fine.reshape(rows * pitch, 4, columns * pitch, 4, 3).mean(axis=(1, 3))).astype(np.uint8)


def fitted(pixels: Pixels, target_bytes: int) -> VectorImage:
    image = vectorize(pixels, None, Options(target_bytes=target_bytes))
    assert len(image.to_bytes()) <= target_bytes
    return image


def mse(image: VectorImage) -> float:
    assert image.report is not None
    return image.report.mse


def test_a_small_file_holds_all_regions_of_a_flat_picture() -> None:
    """19 regions in 1.2 KB; a third of them, each with 350 bytes, would leave an error of hundreds."""
    image = fitted(signs(), 1200)
    assert len(image.labels) == 19
    assert mse(image) < 25


@pytest.mark.parametrize("picture", [signs(), skimage.data.chelsea()[80:200, 120:280]])
def test_more_bytes_are_no_worse(picture: Pixels) -> None:
    errors = [mse(fitted(picture, size)) for size in (400, 900, 2000, 4500)]
    assert all(more <= 1.03 * less + 0.5 for less, more in zip(errors, errors[1:], strict=False))
    assert errors[-1] < errors[0] / 4


def test_borders_that_do_not_fit_are_left_out() -> None:
    """The borders of all 51 regions take about 2 KB: as many are drawn as there is room for."""
    regions = [len(fitted(signs(4, 4, 48), size).labels) for size in (300, 900)]
    assert regions == sorted(regions)
    assert 1 <= regions[0] < regions[1] < 49


def test_a_photo_is_divided_as_far_as_its_bytes_pay_for_borders() -> None:
    coffee = skimage.data.coffee()
    counts = [len(automatic_regions(coffee, Options(target_bytes=1000 * k)).names) for k in (1, 8, 64)]
    assert counts[0] == 1
    assert counts[0] < counts[1] < counts[2]
    unbounded = automatic_regions(coffee, Options(target_bytes=8000, max_points=0))
    assert len(unbounded.names) < counts[1], "no region is divided only for the points it may hold"


def test_as_many_regions_as_are_asked_for_whatever_the_size() -> None:
    asked = automatic_regions(signs(), Options(regions=5, target_bytes=500))
    assert len(asked.names) == 5
