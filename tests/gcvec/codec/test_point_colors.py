"""Colours of control points: what is known nearby, what it predicts, and that they come back."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gcvec.codec.blending import ALONG
from gcvec.codec.colors import FRACTION
from gcvec.codec.echo import silence
from gcvec.codec.mixing import Model, fresh_model
from gcvec.codec.neighborhoods import neighborhoods
from gcvec.codec.point_colors import (
    POINT_COUNTERS,
    POINT_INPUTS,
    POINT_ROWS,
    code_point_colors,
)
from gcvec.codec.range_coder import finish, overrun, reader, writer
from gcvec.codec.strides import crowds_by_stride

Ints = NDArray[np.int64]

HEIGHT, WIDTH = 60, 90


def scattered(share: float, seed: int) -> tuple[NDArray[np.uint8], Ints, Ints]:
    """A bitmap, its points by rows, and the patch of each."""
    rng = np.random.default_rng(seed)
    occupied = (rng.random((HEIGHT, WIDTH)) < share).astype(np.uint8)
    ys, xs = np.nonzero(occupied)
    return occupied, np.stack([xs, ys], axis=1), (xs + 10 * np.sin(ys) > 50).astype(np.int64)


def model() -> Model:
    return fresh_model(POINT_COUNTERS, POINT_ROWS, POINT_INPUTS)


def rings(points: Ints, patch: Ints, i: int) -> list[int]:
    """The known points of the patch of point i within 48 pixels, in the order of the search."""
    dx, dy = (points[:i] - points[i]).T
    ring = np.maximum(abs(dx), abs(dy))
    (known,) = np.nonzero((patch[:i] == patch[i]) & (ring <= 48))
    order = np.lexsort([column[known] for column in (dx, dy, ring, dx * dx + dy * dy)])
    return [int(j) for j in known[order[:10]]]


@pytest.mark.parametrize("share", [0.002, 0.05, 0.6])
def test_the_nearest_known_points_are_found(share: float) -> None:
    _, points, patch = scattered(share, seed=3)
    found = neighborhoods(points, patch, HEIGHT, WIDTH)
    for i in range(len(points)):
        expected, n = rings(points, patch, i), found.known[i]
        assert found.near[i, :n].tolist() == expected
        np.testing.assert_array_equal(found.square[i, :n], ((points[expected] - points[i]) ** 2).sum(axis=1))


def test_kriging_solves_its_equations() -> None:
    _, points, patch = scattered(0.05, seed=4)
    found = neighborhoods(points, patch, HEIGHT, WIDTH)
    assert set(found.known.tolist()) == set(range(11))
    for i, (near, n) in enumerate(zip(points[found.near], found.known, strict=True)):
        near = near[:n]
        apart = np.linalg.norm((near[:, None] - near[None]).astype(float), axis=2)
        away = np.linalg.norm((near - points[i]).astype(float), axis=1)
        expected = np.linalg.solve(1 / (1 + apart / 20) + 0.02 * np.eye(n), 1 / (1 + away / 20))
        np.testing.assert_allclose(found.share[i, :n], expected, rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("share", [0.0, 0.002, 0.05, 0.6])
def test_coordinates_are_read_as_they_were_written(share: float) -> None:
    occupied, points, patch = scattered(share, seed=5)
    strides = np.random.default_rng(8).integers(1, 97, len(points))
    crowds = crowds_by_stride(strides)
    wanted = np.random.default_rng(6).normal(0, 5, (len(points), 3)) + np.sin(points[:, :1] / 9) * 20
    written, read = np.zeros(wanted.shape, np.int64), np.zeros(wanted.shape, np.int64)
    around = neighborhoods(points, patch, HEIGHT, WIDTH)
    coder = writer(100_000)
    code_point_colors(
        coder, model(), points, patch, occupied, around, ALONG, strides, crowds, silence(), wanted, written
    )
    data = finish(coder)
    assert data is not None
    coder, nothing = reader(data), np.zeros(wanted.shape)
    code_point_colors(
        coder, model(), points, patch, occupied, around, ALONG, strides, crowds, silence(), nothing, read
    )
    np.testing.assert_array_equal(read, written)
    assert overrun(coder) == 0
    off_by = np.abs(written - FRACTION * wanted) / strides[:, None]
    assert off_by.max(initial=0) <= 0.5 + 0.12 + 1e-9


def test_a_smooth_picture_costs_next_to_nothing() -> None:
    occupied, points, patch = scattered(0.3, seed=7)
    wanted = np.repeat(points[:, :1] + 0.5 * points[:, 1:], 3, axis=1)
    coder = writer(100_000)
    result = np.zeros(wanted.shape, np.int64)
    around = neighborhoods(points, patch, HEIGHT, WIDTH)
    strides = np.full(len(points), FRACTION)
    crowds = crowds_by_stride(strides)
    code_point_colors(
        coder, model(), points, patch, occupied, around, ALONG, strides, crowds, silence(), wanted, result
    )
    data = finish(coder)
    assert data is not None
    assert len(data) * 8 < 5 * len(points)
