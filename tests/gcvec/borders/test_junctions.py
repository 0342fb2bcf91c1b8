"""Where borders point at, against numpy's fits and where the truth is known."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.borders.chains import Chains
from gcvec.borders.junctions import (
    FAR,
    INERTIA,
    OUTLIER,
    SAMPLES,
    STIFFNESS,
    SWEEPS,
    end_tangent,
    meeting_points,
)


def slow_tangent(samples: np.ndarray, trust: np.ndarray, node: np.ndarray) -> tuple[np.ndarray, float]:
    """A point on the tangent with the normal there, `(4,)`, and its weight."""
    away = np.hypot(*(samples - node).T)
    weight = trust * np.clip(FAR - away, 0, 1)
    way = np.average(samples, axis=0, weights=weight) - node
    way /= np.hypot(*way)
    across = np.array([-way[1], way[0]])
    s, d = (samples - node) @ way, (samples - node) @ across
    reach = max((s * (weight > 0)).max(), 1)
    design = np.stack([np.ones_like(s), s, s * s], axis=1)
    ridge = np.diag([1e-9, 1e-6, STIFFNESS * (FAR / reach) ** 4])
    believed = weight
    for _ in range(SWEEPS):
        matrix = design.T @ (believed[:, None] * design) + ridge
        fit = np.linalg.solve(matrix, design.T @ (believed * d))
        believed = weight / (1 + ((d - design @ fit) / OUTLIER) ** 2)
    normal = (across - fit[1] * way) / np.hypot(1, fit[1])
    return np.concatenate([node + fit[0] * across, normal]), float(np.clip((believed.sum() - 0.5) / 4, 0, 1))


@pytest.mark.parametrize("seed", range(5))
def test_tangents_as_read_out_loud(seed: int) -> None:
    rng = np.random.default_rng(seed)
    node, s = rng.uniform(0, 50, 2), np.arange(1, SAMPLES + 1)
    angle = rng.uniform(0, 2 * np.pi)
    samples = node + s[:, None] * [np.cos(angle), np.sin(angle)] + rng.normal(0, 0.2, (SAMPLES, 2))
    trust, tangent = rng.random(SAMPLES), np.empty(4)
    weight = end_tangent(samples, trust, node, tangent)
    expected, sure = slow_tangent(samples, trust, node)
    np.testing.assert_allclose(tangent, expected, atol=1e-8)
    assert weight == pytest.approx(sure)


def three_rays(meeting: np.ndarray, noise: float) -> tuple[Chains, np.ndarray, np.ndarray]:
    """Straight borders from a node that is drawn in (20, 20), though they all point at `meeting`."""
    away = np.array([[15.0, 3.0], [-9.0, 12.0], [-4.0, -16.0]])
    steps = np.linspace(0, 1, 17)[:, None]
    rows = [meeting + steps * way for way in away]
    points = np.concatenate(rows) + np.random.default_rng(1).normal(0, noise, (51, 2))
    points[::17] = 20
    nodes = np.array([[20.0, 20.0], *(row[-1] for row in rows)])
    points[16::17] = nodes[1:]
    chains = Chains(
        np.arange(3), np.zeros(3, bool), np.array([[0, 1], [0, 2], [0, 3]]), np.array([0, 17, 34, 51])
    )
    return chains, points, nodes


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_a_node_moves_to_where_its_borders_meet(noise: float) -> None:
    meeting = np.array([20.7, 19.4])
    chains, points, nodes = three_rays(meeting, noise)
    placed = meeting_points(chains, points, np.ones(51), nodes)
    # Its inertia against two sure borders' squared distances at each coordinate.
    assert np.hypot(*(placed[0] - meeting)) < 0.1 * INERTIA + 3 * noise + 0.06


def test_a_node_of_borders_that_nobody_knows_stays() -> None:
    chains, points, nodes = three_rays(np.array([20.7, 19.4]), 0)
    np.testing.assert_array_equal(meeting_points(chains, points, np.zeros(51), nodes), nodes)
