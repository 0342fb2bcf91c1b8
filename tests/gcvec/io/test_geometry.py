"""Rings of coordinates, however far away they lie."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from gcvec import InputError
from gcvec.io.geometry import cut_off, ellipse_vertices, ring_from

KEPT = shapely.box(-1e7, -1e7, 1e7, 1e7)


@pytest.mark.parametrize("far", [2e7, 1e9, 1e12])
@pytest.mark.parametrize(
    "ring",
    [
        [0, 0, 1, 0.5, 0, 0.2],
        [-1, 0.1, 1, 0.1, 0, 1],
        [-1, -1, 1, -0.9, 1, 1, -0.8, 1],
        [-1, 0, 0, -1, 1, 0, 0, 1],
        [0.1, 0, 1, 0.3, 1, 0, 1, 0.9, 0, 0.1],
    ],
)
def test_what_a_ring_encloses_near_the_picture_is_kept(ring: list[float], far: float) -> None:
    whole = ring_from([far * value for value in ring], "polygon 1")
    wanted = shapely.intersection(shapely.Polygon(whole), KEPT)
    found = shapely.Polygon(cut_off(whole))
    assert np.abs(cut_off(whole)).max() <= 1e7
    assert shapely.symmetric_difference(found.buffer(0), wanted).area <= 1e-6 * wanted.area


def test_a_ring_near_the_picture_stays_as_it_is() -> None:
    ring = ring_from([-1e7, 0, 1e7, 5, 3, 1e7], "polygon 1")
    assert cut_off(ring) is ring


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), "1e999"])
def test_what_is_not_finite_is_refused(value: object) -> None:
    with pytest.raises(InputError, match="not finite"):
        ring_from([0, value, 1, 1, 2, 0], "polygon 1")


def test_ellipses_of_any_size_have_a_number_of_vertices() -> None:
    numbers = [ellipse_vertices(1, 10.0**size) for size in range(0, 101, 10)]
    assert numbers == sorted(numbers)
