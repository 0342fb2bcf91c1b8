"""Curves against scipy's splines, against themselves refined, and against the least-squares fit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from gcvec import bspline


def knots(m: int, closed: bool) -> np.ndarray:
    k = np.arange(-3.0, m + 4.0)
    return k if closed else np.clip(k, 0, m)


def scipy_spline(control: np.ndarray, closed: bool) -> BSpline:
    m = bspline.segments_of(control, closed)
    wrapped = np.vstack([control, control[:3]]) if closed else control
    return BSpline(knots(m, closed), wrapped, 3)


curves = given(
    m=st.integers(1, 12), closed=st.booleans(), seed=st.integers(0, 2**32 - 1), d=st.sampled_from([1, 2, 3])
)


def random_curve(m: int, closed: bool, seed: int, d: int) -> tuple[np.ndarray, np.ndarray]:
    """Control points and parameters, knots among them."""
    rng = np.random.default_rng(seed)
    m = max(m, 3) if closed else m
    control = rng.normal(size=(m if closed else m + 3, d))
    return control, np.concatenate([np.arange(m + 1.0), rng.uniform(0, m, 20)])


@settings(deadline=None)
@curves
def test_evaluation_equals_scipy(m: int, closed: bool, seed: int, d: int) -> None:
    control, u = random_curve(m, closed, seed, d)
    np.testing.assert_allclose(
        bspline.evaluate(control, u, closed), scipy_spline(control, closed)(u), atol=1e-12
    )


@settings(deadline=None)
@curves
def test_halving_the_segments_keeps_the_curve(m: int, closed: bool, seed: int, d: int) -> None:
    control, u = random_curve(m, closed, seed, d)
    finer = bspline.refine(control, closed)
    assert bspline.segments_of(finer, closed) == 2 * bspline.segments_of(control, closed)
    np.testing.assert_allclose(
        bspline.evaluate(finer, 2 * u, closed), bspline.evaluate(control, u, closed), atol=1e-12
    )


@settings(deadline=None)
@curves
def test_bezier_pieces_trace_the_curve(m: int, closed: bool, seed: int, d: int) -> None:
    control, _ = random_curve(m, closed, seed, d)
    pieces = bspline.bezier(control, closed)
    t = np.linspace(0, 1, 7)
    bernstein = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    for s, piece in enumerate(pieces):
        np.testing.assert_allclose(bernstein @ piece, bspline.evaluate(control, s + t, closed), atol=1e-12)


def test_closed_curve_is_twice_continuously_differentiable_at_the_seam() -> None:
    control = np.random.default_rng(5).normal(size=(7, 2))
    pieces = bspline.bezier(control, closed=True)
    last, first = pieces[-1], pieces[0]
    np.testing.assert_allclose(last[3], first[0], atol=1e-14)
    np.testing.assert_allclose(last[3] - last[2], first[1] - first[0], atol=1e-14)
    np.testing.assert_allclose(
        last[3] - 2 * last[2] + last[1], first[0] - 2 * first[1] + first[2], atol=1e-13
    )


def arc_samples(n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 4, n))
    return np.stack([30 * np.cos(angle), 20 * np.sin(angle)], axis=1) + rng.normal(0, 0.3, (n, 2))


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
    np.testing.assert_allclose(bspline.fit(samples, m, iterations=200_000), expected, atol=1e-6)


def test_pia_error_falls_with_every_sweep_towards_least_squares() -> None:
    samples = arc_samples(60, 1)
    u = chord_parameters(samples, 6)

    def error(iterations: int) -> float:
        fitted = bspline.fit(samples, 6, iterations=iterations)
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
    np.testing.assert_allclose(bspline.fit(samples, m, closed=True, iterations=100_000), expected, atol=1e-6)


@settings(deadline=None, max_examples=40)
@given(n=st.integers(2, 60), seed=st.integers(0, 10**6), distance=st.sampled_from([0.25, 0.5, 2.0]))
def test_fit_within_comes_as_close_as_asked(n: int, seed: int, distance: float) -> None:
    steps = np.random.default_rng(seed).integers(0, 2, n - 1)
    samples = np.concatenate([[[0, 0]], np.cumsum(np.stack([1 - steps, steps], axis=1), axis=0)]).astype(
        float
    )
    control = bspline.fit_within(samples, distance)
    m = bspline.segments_of(control, closed=False)
    np.testing.assert_array_equal(control[[0, -1]], samples[[0, -1]])
    deviation = np.hypot(*(bspline.evaluate(control, chord_parameters(samples, m)) - samples).T).max()
    assert deviation <= distance or m == n - 1


def test_fit_within_spends_few_segments_on_a_smooth_curve() -> None:
    angle = np.linspace(0, 2 * np.pi, 400)
    circle = 50 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert bspline.segments_of(bspline.fit_within(circle, 0.5, closed=True), closed=True) <= 8
