"""Rasters of single patches: as coarse as they may be, and right where the patch is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from gcvec.export import patch_rasters as module
from gcvec.export.patch_rasters import (
    DOUBLINGS,
    FINEST,
    MARGIN,
    REACH,
    TOLERANCE,
    PatchRaster,
    _coarsest,
    _continued,
    _difference,
    _Painted,
    _Painter,
    patch_rasters,
)
from tests.gcvec.scenes import vectorized

LOW, HIGH = np.array([3.0, 4.0]), np.array([67.0, 44.0])
Coloring = Callable[[np.ndarray, np.ndarray], np.ndarray]


def painter(color: Coloring, pieces: int = 1, high: np.ndarray = HIGH) -> _Painter:
    """A rectangle in so many by so many pieces of two triangles each, coloured by its places."""
    x, y = (np.linspace(a, b, pieces + 1) for a, b in zip(LOW, high, strict=True))
    places = np.stack(np.meshgrid(x, y), axis=2).reshape(-1, 2)
    n = pieces + 1
    first = (np.arange(pieces)[:, None] * n + np.arange(pieces)).ravel()[:, None]
    corners = np.concatenate([np.add(first, [0, 1, n]), np.add(first, [1, n + 1, n])])
    return _Painter(places, corners, color(*places.T), corners)


def even(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.broadcast_to([0.2, 0.6, 0.8], (len(x), 3)) + 0 * y[:, None]


def ramp(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return np.stack([x / 80, y / 80, 0.9 - x / 200 - y / 200], axis=1)


def checks(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Different at every vertex."""
    return np.random.default_rng(0).uniform(0, 1, (len(x), 3)) + 0 * y[:, None]


def centres(found: PatchRaster) -> tuple[np.ndarray, np.ndarray]:
    """Places `(h, w)` of the middles of a raster's samples."""
    height, width = found.samples.shape[:2]
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return found.x + found.step * x, found.y + found.step * y


def test_an_even_patch_needs_the_coarsest_samples() -> None:
    found = _coarsest(painter(even), FINEST)
    assert found.step == FINEST * 2**DOUBLINGS
    assert (found.samples == [51, 153, 204]).all()


def test_detail_asks_for_finer_samples() -> None:
    steps = [_coarsest(painter(checks, pieces), FINEST).step for pieces in (1, 8, 32)]
    assert steps == sorted(steps, reverse=True)
    assert steps[-1] < steps[0]


def test_a_little_detail_in_a_large_patch_asks_for_finer_samples_too() -> None:
    """It hardly counts in the mean of the patch."""

    def checked_corner(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.where(((x < 40) & (y < 30))[:, None], checks(x, y), even(x, y))

    there = painter(checked_corner, 200, np.array([803.0, 504.0]))
    fine, coarse = there.paint(FINEST), there.paint(8 * FINEST)
    assert mean_difference(coarse.colors, fine, 8) < TOLERANCE
    assert _coarsest(there, FINEST).step < 8 * FINEST


def mean_difference(coarse: np.ndarray, fine: _Painted, ratio: int) -> float:
    return float(_difference(coarse, fine, ratio)[fine.covered].mean())


@pytest.mark.parametrize("step", [0.5, 2.0, 8.0])
def test_samples_go_beyond_the_patch_on_every_side(step: float) -> None:
    found = painter(ramp).paint(step).rounded()
    height, width = found.samples.shape[:2]
    assert (found.x, found.y) == (LOW[0] - MARGIN * step, LOW[1] - MARGIN * step)
    assert found.x + width * step >= HIGH[0] + MARGIN * step
    assert found.y + height * step >= HIGH[1] + MARGIN * step


@pytest.mark.parametrize("step", [0.5, 2.0])
def test_samples_inside_have_the_colours_of_their_middles(step: float) -> None:
    """A ramp's average over a square is its colour in the middle."""
    found = painter(ramp).paint(step).rounded()
    x, y = centres(found)
    inside = (np.abs(np.stack([x, y], axis=-1) - (LOW + HIGH) / 2) < (HIGH - LOW) / 2 - step).all(axis=-1)
    expected = 255 * ramp(x[inside], y[inside])
    assert inside.sum() > 100
    assert np.abs(found.samples[inside] - expected).max() <= 0.51


def test_coarse_samples_of_a_ramp_are_as_good_as_fine_ones() -> None:
    """Interpolation gives it back, but for the rim, where samples reach beyond the patch."""
    fine, coarse = painter(ramp).paint(0.5), painter(ramp).paint(1.0)
    assert mean_difference(coarse.colors, fine, 2) < TOLERANCE
    assert mean_difference(coarse.colors + 0.1, fine, 2) == pytest.approx(0.1, abs=TOLERANCE)


def test_colours_go_on_beyond_what_is_covered() -> None:
    """Those of the nearest covered sample, as if that were covered wholly; far off their mean."""
    painted = np.zeros((12, 20, 4))
    painted[5, 4] = [0.1, 0.2, 0.05, 0.5]
    painted[5, 5] = [0.6, 0.6, 0.6, 1.0]
    found = _continued(painted)
    np.testing.assert_allclose(found[5, 4], [0.2, 0.4, 0.1])
    np.testing.assert_allclose(found[3, 3], [0.2, 0.4, 0.1])
    np.testing.assert_allclose(found[5, 5 + int(REACH)], 0.6)
    np.testing.assert_allclose(found[5, 6 + int(REACH)], [0.4, 0.5, 0.35])


def test_a_patch_that_covers_nothing_has_its_corners_mean() -> None:
    """As after an edit that turned it over."""
    line, corners = np.array([[2.0, 2], [6, 6], [4, 4]]), np.array([[0, 1, 2]])
    flat = _Painter(line, corners, np.eye(3), corners)
    assert (flat.paint(1.0).rounded().samples == 85).all()


def test_there_is_one_a_patch_around_it() -> None:
    image = vectorized("quadrants")
    rasters = list(patch_rasters(image))
    assert len(rasters) == len(image.labels)
    owner = image.foundation.geometry.patch_at()
    for patch, found in enumerate(rasters):
        ys, xs = np.nonzero(owner == patch)
        height, width = found.samples.shape[:2]
        assert found.x < xs.min() + 1
        assert found.y < ys.min() + 1
        assert found.x + width * found.step > xs.max()
        assert found.y + height * found.step > ys.max()


def test_large_pictures_have_larger_samples(monkeypatch: pytest.MonkeyPatch) -> None:
    """No more of them than a picture may have, in all."""
    image = vectorized("quadrants")
    most = image.width * image.height // 3
    monkeypatch.setattr(module, "MOST_SAMPLES", most)
    steps = np.array([found.step for found in patch_rasters(image)])
    assert (image.width * image.height / steps**2 <= most).all()
    assert steps.min() >= 2 * FINEST
