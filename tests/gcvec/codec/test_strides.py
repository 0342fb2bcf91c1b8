"""How coarsely colours are stored, against the energy that they have in the picture."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from skimage import data

from gcvec import Options, VectorImage, vectorize
from gcvec.codec.colors import FRACTION
from gcvec.codec.former import former_crowds
from gcvec.codec.strides import (
    COARSEST_BOUNDARY_STRIDE,
    COARSEST_STRIDE,
    USUAL_AREA,
    crowds_by_stride,
    strides,
)
from gcvec.raster.coverage import Coverage

Floats = NDArray[np.float64]


def energies(image: VectorImage) -> Floats:
    """Squared sum over the pixels of what each unknown gives to them."""
    drawing, operator, corner_color = image.canvas.unit
    coverage: Coverage = image.canvas.coverage(drawing)
    given = coverage.matrix(corner_color, operator.shape[0]) @ operator
    return np.asarray(given.power(2).sum(axis=0)).ravel()


def spread(values: Floats) -> float:
    return float(np.log(values).std())


@cache
def photo() -> VectorImage:
    """A picture with smooth and with textured regions."""
    return vectorize(np.ascontiguousarray(data.rocket()[40:180, 230:400]), None, Options(target_mse=5))


def test_rounding_adds_about_the_same_by_every_point() -> None:
    """What rounding adds goes with the energy and the square of the stride."""
    image = photo()
    energy = energies(image)[len(image.boundary_colors) :]
    stride = strides(image.canvas).points
    held = stride < COARSEST_STRIDE
    added = energy[held] * (stride[held] / FRACTION) ** 2
    assert spread(energy[held]) > 0.5
    assert spread(added) < 0.15
    assert np.median(added) == pytest.approx(8.8, rel=0.15)


def test_boundary_colors_add_about_as_much_as_points() -> None:
    """Within a factor of two: their blending functions have many shapes."""
    image = photo()
    stride = strides(image.canvas).boundary
    used = stride < COARSEST_BOUNDARY_STRIDE
    added = energies(image)[: len(stride)][used] * (stride[used] / FRACTION) ** 2
    assert 8.8 / 2 < np.median(added) < 8.8 * 2
    assert spread(added) < 0.75 * spread(energies(image)[: len(stride)][used])


def test_a_point_alone_has_the_stride_of_its_triangles() -> None:
    """By the formula, of areas that are summed up triangle by triangle."""
    image = photo()
    mesh = image.canvas.mesh
    corners = mesh.vertices[mesh.triangles]
    area = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 2
    around = np.array(
        [area[(mesh.triangles == v).any(axis=1)].sum() for v in range(mesh.n_samples, mesh.first_free)]
    )
    expected = np.clip(FRACTION * np.sqrt(USUAL_AREA / around), 1, COARSEST_STRIDE)
    np.testing.assert_allclose(strides(image.canvas).points, expected, atol=0.5, rtol=2e-3)


def test_crowds_go_by_strides() -> None:
    assert crowds_by_stride(np.array([1, 30, 31, 96])).tolist() == [1, 30, 31, 31]


def test_crowds_of_former_files_count_the_points_around() -> None:
    occupied = (np.random.default_rng(1).random((20, 30)) < 0.5).astype(np.uint8)
    ys, xs = np.nonzero(occupied)
    padded = np.pad(occupied, 3)
    expected = [min(int(padded[y : y + 7, x : x + 7].sum()) // 3, 15) for x, y in zip(xs, ys, strict=True)]
    assert former_crowds(np.stack([xs, ys], axis=1), occupied).tolist() == expected
