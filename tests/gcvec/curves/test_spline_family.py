"""Families of splines do what each of their splines does alone."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BSpline

from gcvec.curves import bspline
from gcvec.curves.spline_family import SplineFamily


@st.composite
def families(draw: st.DrawFn) -> tuple[SplineFamily, np.ndarray]:
    """A few open and closed curves with random control points."""
    shapes = draw(st.lists(st.tuples(st.integers(3, 9), st.booleans()), min_size=1, max_size=5))
    counts = [m if closed else m + 3 for m, closed in shapes]
    family = SplineFamily(np.cumsum([0, *counts]), np.array([closed for _, closed in shapes]))
    return family, np.random.default_rng(draw(st.integers(0, 99))).normal(size=(sum(counts), 2))


@given(families())
def test_family_evaluates_and_splits_like_its_members(made: tuple[SplineFamily, np.ndarray]) -> None:
    family, control = made
    rng = np.random.default_rng(0)
    curve = rng.integers(0, len(family.closed), 50)
    u = rng.uniform(0, family.segments[curve])
    index, weight = family.basis(curve, u)
    points = np.einsum("nk,nkd->nd", weight, control[index])
    pieces = family.bezier(control)
    for c, closed in enumerate(family.closed):
        own = control[family.offsets[c] : family.offsets[c + 1]]
        expected = bspline.evaluate(own, u[curve == c], bool(closed))
        np.testing.assert_allclose(points[curve == c], expected, atol=1e-12)
        of_curve = pieces[family.first_segment[c] : family.first_segment[c + 1]]
        np.testing.assert_array_equal(of_curve, bspline.bezier(own, bool(closed)))


@given(families())
def test_bend_is_the_largest_second_derivative_of_a_segment(made: tuple[SplineFamily, np.ndarray]) -> None:
    family, control = made
    bend = family.bend(control)
    for c, closed in enumerate(family.closed):
        own = control[family.offsets[c] : family.offsets[c + 1]]
        m = int(family.segments[c])
        if closed:
            scipy_curve = BSpline(np.arange(-3.0, m + 4), np.concatenate([own, own[:3]]), 3)
        else:
            scipy_curve = BSpline(np.clip(np.arange(-3.0, m + 4), 0, m), own, 3)
        inside = np.arange(m)[:, None] + np.array([1e-9, 1 - 1e-9])
        expected = np.linalg.norm(scipy_curve.derivative(2)(inside), axis=-1).max(axis=1)
        of_curve = bend[family.first_segment[c] : family.first_segment[c + 1]]
        np.testing.assert_allclose(of_curve, expected, rtol=1e-6, atol=1e-6)
