"""Fitted curves against the least-squares fit, and against the iteration as the paper writes it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from gcvec.curves import bspline, spline_fit
from tests.gcvec.curves.single_splines import fit, fit_within, knots


def arc_samples(n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 4, n))
    return np.stack([30 * np.cos(angle), 20 * np.sin(angle)], axis=1) + rng.normal(0, 0.3, (n, 2))


def ring_samples(n: int) -> np.ndarray:
    angle = np.linspace(0, 2 * np.pi, n + 1)
    return np.stack([30 * np.cos(angle), (20 + 2 * np.cos(5 * angle)) * np.sin(angle)], axis=1)


def chord_parameters(samples: np.ndarray, m: int) -> np.ndarray:
    length = np.concatenate([[0], np.cumsum(np.hypot(*np.diff(samples, axis=0).T))])
    return np.asarray(length * (m / length[-1]))


@pytest.mark.parametrize("m", [1, 2, 5, 9])
def test_pia_converges_to_the_least_squares_fit(m: int) -> None:
    samples = arc_samples(80, m)
    u = chord_parameters(samples, m)
    design = BSpline.design_matrix(np.minimum(u, m), knots(m, False), 3).toarray()
    ends = design[:, [0, -1]] @ samples[[0, -1]]
    inner = np.linalg.lstsq(design[:, 1:-1], samples - ends, rcond=None)[0]
    expected = np.vstack([samples[:1], inner, samples[-1:]])
    np.testing.assert_allclose(fit(samples, m, sweeps=200_000), expected, atol=1e-6)


def test_pia_error_falls_with_every_sweep_towards_least_squares() -> None:
    samples = arc_samples(60, 1)
    u = chord_parameters(samples, 6)

    def error(iterations: int) -> float:
        fitted = fit(samples, 6, sweeps=iterations)
        return float(((bspline.evaluate(fitted, u) - samples) ** 2).sum())

    errors = [error(n) for n in (0, 1, 3, 10, 30, 100, 1000)]
    assert all(after <= before for before, after in pairwise(errors))


def test_closed_pia_converges_to_the_periodic_least_squares_fit() -> None:
    angle = np.linspace(0, 2 * np.pi, 61)
    samples = np.stack([9 * np.cos(angle), 5 * np.sin(angle) + np.cos(3 * angle)], axis=1)
    m = 8
    u = chord_parameters(samples, m)
    index, weight = bspline.basis(u, m, closed=True)
    design = np.zeros((len(u), m))
    np.add.at(design, (np.arange(len(u))[:, None], index), weight)
    expected = np.linalg.lstsq(design, samples, rcond=None)[0]
    np.testing.assert_allclose(fit(samples, m, closed=True, sweeps=100_000), expected, atol=1e-6)


@settings(max_examples=40)
@given(n=st.integers(2, 60), seed=st.integers(0, 10**6), distance=st.sampled_from([0.25, 0.5, 2.0]))
def test_fit_within_comes_as_close_as_asked(n: int, seed: int, distance: float) -> None:
    steps = np.random.default_rng(seed).integers(0, 2, n - 1)
    samples = np.concatenate([[[0, 0]], np.cumsum(np.stack([1 - steps, steps], axis=1), axis=0)]).astype(
        float
    )
    control = fit_within(samples, distance)
    m = bspline.segments_of(control, closed=False)
    np.testing.assert_array_equal(control[[0, -1]], samples[[0, -1]])
    deviation = np.hypot(*(bspline.evaluate(control, chord_parameters(samples, m)) - samples).T).max()
    assert deviation <= distance or m == n - 1


def test_fit_within_spends_few_segments_on_a_smooth_curve() -> None:
    angle = np.linspace(0, 2 * np.pi, 400)
    circle = 50 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert bspline.segments_of(fit_within(circle, 0.5, closed=True), closed=True) <= 8


def slow_fit(samples: np.ndarray, importance: np.ndarray, m: int, closed: bool) -> np.ndarray:
    """Equations (4) and (5) word by word: residuals at samples, then their weighted means."""
    u = chord_parameters(samples, m)
    index, weight = bspline.basis(u, m, closed)
    n = m if closed else m + 3
    greville = np.arange(-1, m - 1) % m if closed else knots(m, False)[1:-1]
    greville = greville if closed else np.convolve(greville, np.ones(3) / 3, "valid")
    control = np.stack([np.interp(greville, u, samples[:, c]) for c in range(2)], axis=1)
    design = np.zeros((len(samples), n))
    np.add.at(design, (np.arange(len(samples))[:, None], index), weight)
    share = design * importance[:, None]
    for _ in range(spline_fit.SWEEPS):
        shift = (share.T @ (samples - design @ control)) / share.sum(axis=0)[:, None]
        shift[[0, -1]] *= closed
        control += shift
        if np.abs(shift).max() < spline_fit.STILL:
            break
    return control


@pytest.mark.parametrize("closed", [False, True])
def test_all_curves_at_once_as_one_by_one(closed: bool) -> None:
    rows = [arc_samples(n, n) for n in (12, 40, 90)]
    rows = [ring_samples(n) for n in (12, 40, 90)] if closed else rows
    distances = [np.random.default_rng(len(row)).uniform(0.3, 0.9, len(row)) for row in rows]
    fitted = spline_fit.fit_all_within(
        np.concatenate(rows),
        np.cumsum([0, *map(len, rows)]),
        np.concatenate(distances),
        np.array([4, 9, 15]),
        np.full(3, closed),
    )
    assert len(fitted) == 3
    for control, samples, distance in zip(fitted, rows, distances, strict=True):
        m = bspline.segments_of(control, closed)
        expected = slow_fit(samples, distance.min() ** 2 / distance**2, m, closed)
        np.testing.assert_allclose(control, expected, atol=1e-9)
