"""Harmonic coordinates: their defining properties on random domains, and convergence to closed forms."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import integrate

from gcvec.patches import harmonic
from gcvec.patches.harmonic import cotangent_laplacian, harmonic_coordinates, harmonic_extension
from gcvec.patches.triangulation import constrained_delaunay

Floats = np.ndarray
Inside = Callable[[Floats, Floats], np.ndarray]


@dataclass(frozen=True)
class Domain:
    """A meshed polygon with holes; mesh vertices: polygon corners first, then further boundary points."""

    vertices: Floats
    triangles: np.ndarray
    edges: np.ndarray
    on_edge: np.ndarray
    along: Floats

    @property
    def interior(self) -> np.ndarray:
        return np.flatnonzero(self.on_edge < 0)

    def coordinates(self, points: np.ndarray) -> Floats:
        return harmonic_coordinates(
            self.vertices, self.triangles, self.edges, self.on_edge, self.along, points
        )


def meshed(rings: list[Floats], inside: Floats, pieces: int) -> Domain:
    """Mesh of the domain bounded by `rings`, every edge cut in `pieces`, with the vertices `inside`."""
    corners = np.concatenate(rings)
    edges, n = [], 0
    for ring in rings:
        own = np.arange(n, n + len(ring))
        edges.append(np.stack([own, np.roll(own, -1)], axis=1))
        n += len(ring)
    edge = np.concatenate(edges)
    t = np.arange(1, pieces) / pieces
    between = corners[edge[:, 0], None] + t[:, None] * (corners[edge[:, 1]] - corners[edge[:, 0]])[:, None]
    ids = n + np.arange(len(edge) * (pieces - 1)).reshape(len(edge), -1)
    walk = np.concatenate([edge[:, :1], ids, edge[:, 1:]], axis=1)
    segments = np.stack([walk[:, :-1].ravel(), walk[:, 1:].ravel()], axis=1)
    vertices = np.concatenate([corners, between.reshape(-1, 2), inside])
    triangles, _ = constrained_delaunay(vertices, segments)
    outside_first = np.full(len(inside), -1)
    corner_edge = np.empty(n, np.int64)
    corner_edge[edge[:, 0]] = np.arange(len(edge))
    on_edge = np.concatenate([corner_edge, np.repeat(np.arange(len(edge)), pieces - 1), outside_first])
    along = np.concatenate([np.zeros(n), np.tile(t, len(edge)), np.zeros(len(inside))])
    return Domain(vertices, triangles, edge, on_edge, along)


def star(rng: np.random.Generator, centre: tuple[float, float], radius: float, n: int) -> Floats:
    """A simple polygon, not convex: n corners about a centre at random distances."""
    angle = 2 * np.pi * (np.arange(n) + rng.uniform(-0.3, 0.3, n)) / n
    distance = radius * rng.uniform(0.7, 1.0, n)
    return np.array(centre) + distance[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def random_domain(seed: int, n: int, holes: int, n_inside: int) -> Domain:
    """A star with small stars cut out, and random vertices well inside."""
    rng = np.random.default_rng(seed)
    places = [(-14.0, 2.0), (10.0, 9.0), (6.0, -12.0)][:holes]
    rings = [star(rng, (0, 0), 60, n), *(star(rng, p, 7, 5)[::-1] for p in places)]
    candidates = rng.uniform(-30, 30, (n_inside, 2))
    clear = np.hypot(*candidates.T) < 26
    for x, y in places:
        clear &= np.hypot(candidates[:, 0] - x, candidates[:, 1] - y) > 8
    # Cut edges finely: the Delaunay property, and so the maximum principle, holds at the boundary too.
    return meshed(rings, candidates[clear], 12)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(7, 14),
    holes=st.integers(0, 3),
    n_inside=st.integers(0, 120),
    n_points=st.integers(0, 12),
)
def test_coordinates_are_a_partition_of_unity_that_reproduces_positions(
    seed: int, n: int, holes: int, n_inside: int, n_points: int
) -> None:
    domain = random_domain(seed, n, holes, n_inside)
    points = domain.interior[:n_points]
    coordinates = domain.coordinates(points)
    corners = np.unique(domain.edges)
    places = domain.vertices[np.concatenate([corners, points])]
    assert coordinates.shape == (len(domain.vertices), len(places))
    np.testing.assert_allclose(coordinates.sum(axis=1), 1, atol=1e-9)
    np.testing.assert_allclose(coordinates @ places, domain.vertices, atol=1e-9)
    assert coordinates.min() >= -1e-9
    np.testing.assert_allclose(
        coordinates[np.concatenate([corners, points])], np.eye(len(places)), atol=1e-12
    )


def test_coordinates_are_linear_along_edges() -> None:
    domain = random_domain(3, 8, 1, 60)
    coordinates = domain.coordinates(domain.interior[:5])
    for i in np.flatnonzero(domain.on_edge >= 0):
        a, b = domain.edges[domain.on_edge[i]]
        expected = np.zeros(coordinates.shape[1])
        expected[a] += 1 - domain.along[i]
        expected[b] += domain.along[i]
        np.testing.assert_allclose(coordinates[i], expected, atol=1e-15)


def test_laplacian_is_symmetric_and_exact_for_linear_functions() -> None:
    domain = random_domain(5, 9, 2, 80)
    laplacian = cotangent_laplacian(domain.vertices, domain.triangles)
    assert abs(laplacian - laplacian.T).max() < 1e-12
    linear = np.column_stack([np.ones(len(domain.vertices)), domain.vertices])
    assert np.abs((laplacian @ linear)[domain.interior]).max() < 1e-9
    x, y = domain.vertices.T
    energy = x @ (laplacian @ x)
    a, b, c = (domain.vertices[domain.triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    area = (ux * vy - uy * vx).sum() / 2
    assert energy == pytest.approx(area)
    assert x @ (laplacian @ y) == pytest.approx(0, abs=1e-8)


def grid_inside(keep: Inside, spacing: float, extent: float) -> Floats:
    """Rows of a triangular lattice, slightly shifted so that no four points lie on a circle."""
    rows = np.arange(-extent, extent, spacing * 0.75**0.5)
    points = [
        (x + (k % 2) * spacing / 2, y)
        for k, y in enumerate(rows)
        for x in np.arange(-extent, extent, spacing)
    ]
    points = np.array(points) + np.random.default_rng(0).uniform(-0.05, 0.05, (len(points), 2)) * spacing
    return points[keep(*points.T)]


def rate(errors: list[float]) -> float:
    """Order of convergence over halvings of the mesh size."""
    return float(np.log2(errors[0] / errors[-1]) / (len(errors) - 1))


SQUARE = np.array([(-1.0, -1.0), (1, -1), (1, 1), (-1, 1)])
L_SHAPE = np.array([(-1.0, -1.0), (1, -1), (1, 0), (0, 0), (0, 1), (-1, 1)])


def in_square(margin: float) -> Inside:
    return lambda x, y: (np.abs(x) < 1 - margin) & (np.abs(y) < 1 - margin)


def in_l_shape(margin: float) -> Inside:
    return lambda x, y: in_square(margin)(x, y) & ((x < -margin) | (y < -margin))


@pytest.mark.parametrize(
    ("ring", "inside"), [(SQUARE, in_square), (L_SHAPE, in_l_shape)], ids=["square", "L"]
)
def test_extension_converges_to_a_harmonic_polynomial(
    ring: Floats, inside: Callable[[float], Inside]
) -> None:
    """x² - y² + cubic terms; smooth up to the corners, so second order even at the re-entrant one."""

    def truth(p: Floats) -> Floats:
        x, y = p.T
        return np.stack([x**2 - y**2, x**3 - 3 * x * y**2, np.exp(x) * np.cos(y)], axis=1)

    errors = []
    for n in (8, 16, 32):
        spacing = 2 / n
        domain = meshed([ring], grid_inside(inside(0.6 * spacing), spacing, 1.0), n)
        laplacian = cotangent_laplacian(domain.vertices, domain.triangles)
        fixed = np.flatnonzero(domain.on_edge >= 0)
        found = harmonic_extension(laplacian, domain.interior, fixed, truth(domain.vertices[fixed]))
        errors.append(float(np.abs(found - truth(domain.vertices[domain.interior])).max()))
    assert errors[-1] < 5e-3
    assert rate(errors) > 1.6


HOLE = np.array([(-0.3, -0.4), (0.5, -0.4), (0.5, 0.2), (-0.3, 0.2)])[::-1]


def test_extension_around_a_hole_converges() -> None:
    """log r, which no polynomial comes near to, its pole in the hole; second order."""

    def truth(p: Floats) -> Floats:
        return np.log(np.hypot(p[:, 0] - 0.1, p[:, 1] + 0.1))[:, None]

    errors = []
    for n in (8, 16, 32):
        spacing = 2 / n
        margin = 0.6 * spacing

        def clear(x: Floats, y: Floats, m: float = margin) -> np.ndarray:
            beside = (x < -0.3 - m) | (x > 0.5 + m) | (y < -0.4 - m) | (y > 0.2 + m)
            return np.asarray(in_square(m)(x, y) & beside)

        domain = meshed([SQUARE, HOLE], grid_inside(clear, spacing, 1.0), n)
        found, expected = extended(domain, truth)
        errors.append(float(np.abs(found - expected).max()))
    assert errors[-1] < 5e-3
    assert rate(errors) > 1.5


def test_extension_at_a_reentrant_corner_converges_as_theory_says() -> None:
    """r^(2/3) sin(2/3 θ) in the L: its gradient has no bound at the corner, which costs a third of the order:
    4/3 in the mean square (Strang and Fix 1973)."""

    def truth(p: Floats) -> Floats:
        angle = (np.arctan2(p[:, 1], p[:, 0]) - np.pi / 2) % (2 * np.pi)
        return (np.hypot(*p.T) ** (2 / 3) * np.sin(2 / 3 * angle))[:, None]

    errors = []
    for n in (8, 16, 32):
        spacing = 2 / n
        domain = meshed([L_SHAPE], grid_inside(in_l_shape(0.6 * spacing), spacing, 1.0), n)
        found, expected = extended(domain, truth)
        errors.append(float(np.sqrt(((found - expected) ** 2).mean())))
    assert 1.1 < rate(errors) < 1.7


def extended(domain: Domain, truth: Callable[[Floats], Floats]) -> tuple[Floats, Floats]:
    """At interior vertices, the extension of the truth's boundary values, and the truth."""
    laplacian = cotangent_laplacian(domain.vertices, domain.triangles)
    fixed = np.flatnonzero(domain.on_edge >= 0)
    found = harmonic_extension(laplacian, domain.interior, fixed, truth(domain.vertices[fixed]))
    return found, truth(domain.vertices[domain.interior])


def poisson(f: Callable[[float], float], r: float, theta: float) -> float:
    """Poisson's integral on the unit disc of boundary values f(angle)."""

    def kernel(phi: float) -> float:
        return f(phi) * (1 - r * r) / (1 - 2 * r * np.cos(theta - phi) + r * r)

    return float(integrate.quad(kernel, -np.pi, np.pi, points=[theta], limit=200)[0] / (2 * np.pi))


def test_coordinates_on_a_disc_converge_to_poissons_integral() -> None:
    """A coordinate of a fine regular polygon: a hat function on the boundary of the disc."""
    errors = []
    for n in (12, 24, 48):
        angle = 2 * np.pi * np.arange(n) / n
        ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        spacing = 2 * np.pi / n
        lattice = grid_inside(lambda x, y, s=spacing: np.hypot(x, y) < 1 - 0.7 * s, spacing, 1.0)
        domain = meshed([ring], lattice, 1)
        coordinates = domain.coordinates(np.zeros(0, np.int64))
        # The boundary function (1 + cos)^2 as a combination of the coordinates of all corners.
        values = coordinates @ (1 + np.cos(angle)) ** 2
        worst = 0.0
        for i in domain.interior[:: max(1, len(domain.interior) // 40)]:
            x, y = domain.vertices[i]
            r, theta = np.hypot(x, y), np.arctan2(y, x)
            worst = max(worst, abs(values[i] - poisson(lambda p: (1 + np.cos(p)) ** 2, r, theta)))
        errors.append(worst)
    assert errors[-1] < 5e-3
    assert rate(errors) > 1.6


def test_few_vertices_are_solved_for_as_many_are(monkeypatch: pytest.MonkeyPatch) -> None:
    domain = meshed([L_SHAPE], grid_inside(in_l_shape(0.1), 0.2, 1.0), 10)
    assert 0 < len(domain.interior) <= harmonic.FEW
    dense, _ = extended(domain, lambda p: p**3)
    monkeypatch.setattr(harmonic, "FEW", 0)
    sparse, _ = extended(domain, lambda p: p**3)
    np.testing.assert_allclose(dense, sparse, atol=1e-12)


def test_no_free_vertices() -> None:
    ring = np.array([(0.0, 0.0), (4, 0), (1, 3)])
    domain = meshed([ring], np.zeros((0, 2)), 1)
    np.testing.assert_array_equal(domain.coordinates(np.zeros(0, np.int64)), np.eye(3))
