"""Curves, their colours, and those of points: what a decoder written from the format's page alone reads."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gcvec import VectorImage
from gcvec.codec.colors import from_coordinates
from gcvec.codec.file import GRAY, decode, encode, predicted_colors
from gcvec.patches.color_space import LEFT, RIGHT
from tests.gcvec.plain_file import Color, PlainFile, PlainMesh, plain_file
from tests.gcvec.scenes import vectorized

DATA = Path(__file__).parents[2] / "data"
GOLDEN = "leaf", "recolored"


@cache
def file_of(name: str) -> bytes:
    return (DATA / f"{name}.gcv").read_bytes() if name in GOLDEN else encode(vectorized(name))


@cache
def both(name: str) -> tuple[VectorImage, PlainFile]:
    """The picture of before, where patches were recoloured, and what the file says."""
    image = decode(file_of(name))
    return image.recoloring.original if image.recoloring else image, plain_file(file_of(name))


@cache
def colors_of(name: str) -> tuple[dict[tuple[int, str], list[Color]], list[Color]]:
    """The coordinates of boundary colours and those of points that a file holds."""
    image, plain = both(name)
    mesh, samples = image.canvas.mesh, image.foundation.samples
    at_nodes = [(-1, float(k)) for k in range(samples.n_nodes)]
    on_curves = zip(
        samples.curve[samples.n_nodes :].tolist(), samples.u[samples.n_nodes :].tolist(), strict=True
    )
    return plain.colors(
        PlainMesh(
            mesh.vertices.tolist(), mesh.triangles.tolist(), mesh.patch.tolist(), [*at_nodes, *on_curves]
        )
    )


every = pytest.mark.parametrize("name", [*GOLDEN, "nested", "needles"])


@every
def test_sizes_labels_and_topology_are_as_the_format_says(name: str) -> None:
    image, plain = both(name)
    assert (plain.width, plain.height, tuple(plain.labels)) == (image.width, image.height, image.labels)
    assert plain.curves == [
        (curve.left, curve.right, curve.start, curve.end, curve.level, curve.segments, hard)
        for curve, hard in zip(image.curves, image.hard, strict=True)
    ]


@every
def test_control_points_are_as_the_format_says(name: str) -> None:
    image, plain = both(name)
    reference = np.concatenate([curve.control_points for curve in image.network.curves])
    np.testing.assert_array_equal(np.concatenate(plain.reference), reference)
    assert (plain.moved is None) == (image.control_points is None) == (name not in GOLDEN)
    if plain.moved is not None:
        np.testing.assert_array_equal(np.concatenate(plain.moved), image.control_points)


@every
def test_boundary_colors_are_as_the_format_says(name: str) -> None:
    image, _ = both(name)
    offsets, unknown = image.foundation.samples.offsets, image.foundation.space.of_control
    seen = set()
    for (c, side), coordinates in colors_of(name)[0].items():
        own = unknown[RIGHT if side == "right" else LEFT, offsets[c] : offsets[c + 1]]
        colors = GRAY + from_coordinates(np.array(coordinates), image.quantization.boundary)
        np.testing.assert_array_equal(colors, image.boundary_colors[own])
        seen.update(own.tolist())
    assert seen == set(range(len(image.boundary_colors)))


@every
def test_points_and_their_colors_are_as_the_format_says(name: str) -> None:
    image, plain = both(name)
    np.testing.assert_array_equal(np.array(plain.points).reshape(-1, 2), image.points)
    base = predicted_colors(image.foundation, image.boundary_colors, image.points)
    coordinates = np.array(colors_of(name)[1])
    assert len(coordinates) > 20
    colors = base + from_coordinates(coordinates, image.quantization.point)
    np.testing.assert_array_equal(colors, image.point_colors)


def test_recolors_are_as_the_format_says() -> None:
    image, (_, plain) = decode(file_of("recolored")), both("recolored")
    boundary_colors, _ = colors_of("recolored")
    assert image.recoloring is not None
    original = image.recoloring.original
    patch_of_points = image.patch_of_points
    recolors = plain.recolors()
    assert len(recolors) == 2
    for patch in range(len(image.labels)):
        own = patch_of_points == patch
        expected = original.point_colors[own]
        if patch in recolors:
            expected = np.clip(expected + np.array(recolors[patch]) / 4080, 0, 1)
        np.testing.assert_array_equal(image.point_colors[own], expected)
    offsets = image.foundation.samples.offsets
    for (c, name), coordinates in boundary_colors.items():
        curve, side = plain.curves[c], RIGHT if name == "right" else LEFT
        patch = curve.right if name == "right" else curve.left
        expected = GRAY + from_coordinates(np.array(coordinates), image.quantization.boundary)
        if patch in recolors:
            expected = np.clip(expected + np.array(recolors[patch]) / 4080, 0, 1)
        own = image.foundation.space.of_control[side, offsets[c] : offsets[c + 1]]
        np.testing.assert_array_equal(image.boundary_colors[own], expected)
        recolored = not curve.on_frame and bool({curve.left, curve.right} & recolors.keys())
        assert image.hard[c] == (bool(curve.hard) or recolored)


def test_coordinates_mean_the_colors_that_the_format_says() -> None:
    axes = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]]) / np.sqrt([[3], [2], [6]])
    coordinates = np.array([[5, -7, 40], [-1, 300, 2]])
    expected = 3 / 1020 * coordinates @ axes / 16
    np.testing.assert_allclose(from_coordinates(coordinates, 3 / 1020), expected, rtol=1e-12)
