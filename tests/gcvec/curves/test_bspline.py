"""Curves against scipy's splines, and against their Bézier pieces."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from gcvec.curves import bspline
from tests.gcvec.curves.single_splines import knots


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


@curves
def test_evaluation_equals_scipy(m: int, closed: bool, seed: int, d: int) -> None:
    control, u = random_curve(m, closed, seed, d)
    np.testing.assert_allclose(
        bspline.evaluate(control, u, closed), scipy_spline(control, closed)(u), atol=1e-12
    )


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
