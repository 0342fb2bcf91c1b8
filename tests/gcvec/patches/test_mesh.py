"""Free points against the rule read out loud; triangulations of whole pictures against areas."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gcvec.patches.mesh import CELL_LEVELS, FINEST_CELL, build_mesh, free_points, jitter
from tests.gcvec.areas import areas, shoelace
from tests.gcvec.scenes import SCENES, foundation_of, no_points, some_points


def free_points_slowly(sites: np.ndarray, width: int, height: int) -> set[tuple[int, int]]:
    """The rule, cell by cell: clear cells whose ancestors are not clear, largest first."""
    found: set[tuple[int, int]] = set()
    covered: set[tuple[int, int]] = set()
    for level in range(CELL_LEVELS, -1, -1):
        size = FINEST_CELL << level
        taken = {(int(x // size), int(y // size)) for x, y in sites}
        here = set()
        # Cells beyond the picture may be clear too, but their middles lie outside.
        for row in range(-(-height // size)):
            for column in range(-(-width // size)):
                around = {(column + i, row + j) for i in (-1, 0, 1) for j in (-1, 0, 1)}
                if (column, row) in covered or around & taken:
                    continue
                here.add((column, row))
                x, y = column * size + size // 2, row * size + size // 2
                if x < width and y < height:
                    found.add((x, y))
        covered = {(2 * x + i, 2 * y + j) for x, y in covered | here for i in (0, 1) for j in (0, 1)}
    return found


@settings(max_examples=40)
@given(
    width=st.integers(1, 1200),
    height=st.integers(1, 1200),
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(0, 30),
)
def test_free_points_follow_the_integer_rule(width: int, height: int, seed: int, n: int) -> None:
    sites = np.random.default_rng(seed).uniform(0, [width, height], (n, 2))
    points = np.floor(free_points(sites, width, height)).astype(int)
    assert len(np.unique(points, axis=0)) == len(points)
    assert {(int(x), int(y)) for x, y in points} == free_points_slowly(sites, width, height)


def test_free_points_of_a_picture_of_odd_cells() -> None:
    assert len(free_points(np.array([[0.0, 0.0]]), 600, 400)) > 0


def test_jitter_stays_within_a_twentieth_of_a_pixel_and_differs_everywhere() -> None:
    y, x = np.mgrid[:200, :200]
    pixels = np.stack([x.ravel(), y.ravel()], axis=1)
    shift = jitter(pixels) - (pixels + 0.5)
    assert np.abs(shift).max() <= 0.05
    assert len(np.unique(shift, axis=0)) > 0.999 * len(shift)
    assert np.abs(shift.mean(axis=0)).max() < 1e-3
    np.testing.assert_array_equal(jitter(pixels[5:6]), jitter(pixels)[5:6])


@given(x=st.integers(0, 2**26), y=st.integers(0, 2**26))
def test_jitter_is_the_hash_of_the_format(x: int, y: int) -> None:
    h = (x * 0x9E3779B1 + y * 0x85EBCA77) % 2**32
    h = (h ^ (h >> 15)) * 0x2C1B3C6D % 2**32
    h = (h ^ (h >> 12)) * 0x297A2D39 % 2**32
    h ^= h >> 15
    across, down = (h & 0xFFFF) / 65536 - 0.5, (h >> 16) / 65536 - 0.5
    expected = [[x + 0.5 + 0.1 * across, y + 0.5 + 0.1 * down]]
    np.testing.assert_array_equal(jitter(np.array([[x, y]])), expected)


@pytest.mark.parametrize("scene", SCENES)
def test_triangles_are_positive_and_fill_each_domain(scene: str) -> None:
    foundation = foundation_of(scene)
    network, samples = foundation.network, foundation.samples
    points = some_points(foundation, 9)
    for chosen in (no_points(), points):
        mesh = build_mesh(network, samples, chosen)
        area = areas(mesh.vertices, mesh.triangles)
        assert area.min() > 0
        assert (mesh.n_samples, mesh.n_points) == (len(samples), len(chosen))
        by_patch = np.bincount(mesh.patch, area, minlength=len(network.loops))
        for k, loops in enumerate(network.loops):
            expected = sum(shoelace(samples.domain[loop_vertices(samples, loop)]) for loop in loops)
            assert by_patch[k] == pytest.approx(expected)
        assert area.sum() == pytest.approx(network.width * network.height)


@pytest.mark.parametrize("scene", SCENES)
def test_only_boundary_samples_lie_on_one_circle(scene: str) -> None:
    """The jitter leaves no tie between two diagonals to any interior vertex."""
    foundation = foundation_of(scene)
    mesh = build_mesh(foundation.network, foundation.samples, some_points(foundation, 60))
    quads = [q for q in diagonals(mesh.triangles) if abs(in_circle(mesh.vertices[q])) < 1e-9]
    assert all(max(quad) < mesh.n_samples for quad in quads)
    if scene == "whole":
        assert quads  # the rectangles between opposite sides of the frame


def diagonals(triangles: np.ndarray) -> list[list[int]]:
    """Of every edge between two triangles, the corners of both: its ends, then the two opposite."""
    opposite: dict[tuple[int, int], int] = {}
    for a, b, c in triangles.tolist():
        opposite |= {(a, b): c, (b, c): a, (c, a): b}
    return [[a, b, c, opposite[b, a]] for (a, b), c in opposite.items() if a < b and (b, a) in opposite]


def in_circle(quad: np.ndarray) -> float:
    """0 if the corners `(4, 2)` lie on one circle, relative to their extent."""
    off = (quad[:3] - quad[3]) / np.abs(quad - quad[3]).max()
    return float(np.linalg.det(np.column_stack([off, (off**2).sum(axis=1)])))


def loop_vertices(samples, loop) -> list[int]:
    """Samples that are the polygon vertices of a loop, in walking order."""
    vertices: list[int] = []
    for curve, forward in loop:
        ends = samples.edge_ends[samples.edge_curve == curve]
        vertices += ends[:, 0].tolist() if forward else ends[::-1, 1].tolist()
    return vertices
