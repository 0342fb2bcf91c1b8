"""First control points lie where a picture bends, as densely as it bends there."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.refinement import seeding
from gcvec.refinement.seeding import find_seeds

SIZE = 96


def seeded(residual: np.ndarray, target_mse: float = 5.0, max_points: int = 0) -> np.ndarray:
    """Seeds of a grey picture on one patch."""
    everywhere = np.zeros(residual.shape, np.int64)
    picture = np.repeat(residual[..., None], 3, axis=2)
    return find_seeds(picture, target_mse, np.zeros(residual.shape, bool), everywhere, max_points)


def waves(length: float, amplitude: float = 0.2) -> np.ndarray:
    x = np.arange(SIZE) * 2 * np.pi / length
    return amplitude * np.add.outer(np.sin(x), np.sin(x))


def test_a_plane_needs_no_points() -> None:
    y, x = np.mgrid[:SIZE, :SIZE] / SIZE
    inside = seeded(0.3 * x - 0.5 * y)
    # Filters repeat the last row beyond the picture's edge: a bend there, and nowhere else.
    assert ((inside < 6) | (inside >= SIZE - 6)).any(axis=1).all()


def test_density_grows_with_the_two_thirds_power_of_the_bend(monkeypatch: pytest.MonkeyPatch) -> None:
    """Eight times the amplitude, or an eighth of the wanted root mean square, is four times the points."""
    monkeypatch.setattr(seeding, "LEAST_BEND", 0.0)
    few, many = len(seeded(waves(24, 0.05), 5.0)), len(seeded(waves(24, 0.4), 5.0))
    assert few > 30
    assert many / few == pytest.approx(4, rel=0.2)
    assert len(seeded(waves(24, 0.05), 5.0 / 64)) == many


def test_points_keep_out_of_blocked_pixels_and_within_the_bound_of_each_patch() -> None:
    residual = np.repeat(waves(12)[..., None], 3, axis=2)
    blocked = np.zeros((SIZE, SIZE), bool)
    blocked[:, ::2] = True
    patch_at = np.repeat(np.arange(4), SIZE // 4)[:, None] * np.ones(SIZE, np.int64)
    points = find_seeds(residual, 5.0, blocked, patch_at, 0)
    assert len(points) > 100
    assert not blocked[points[:, 1], points[:, 0]].any()
    assert (np.lexsort((points[:, 0], points[:, 1])) == np.arange(len(points))).all()
    bounded = find_seeds(residual, 5.0, blocked, patch_at, 60)
    count = np.bincount(patch_at[bounded[:, 1], bounded[:, 0]], minlength=4)
    assert count.max() <= 60
    assert count.min() >= 10


def test_no_error_is_too_small_to_aim_at() -> None:
    picture = waves(24).astype(np.float32)
    assert len(seeded(picture, 5e-324)) == len(seeded(picture, 1e-6)) > 0.15 * SIZE**2
