"""One curve alone: its knots, and fits."""

from __future__ import annotations

import numpy as np

from gcvec.curves.spline_fit import fit_all_within, fit_spline


def knots(m: int, closed: bool) -> np.ndarray:
    k = np.arange(-3.0, m + 4.0)
    return k if closed else np.clip(k, 0, m)


def fit(samples: np.ndarray, segments: int, closed: bool = False, sweeps: int = 1000) -> np.ndarray:
    """Control points `(k, 2)` of the least-squares curve through `samples`, by equations (4) and (5)."""
    control, _ = fit_spline(samples, np.ones(len(samples)), segments, closed, sweeps, 1e-12)
    return np.asarray(control)


def fit_within(samples: np.ndarray, distance: float, segments: int = 1, closed: bool = False) -> np.ndarray:
    """`fit_all_within` of one curve, with one distance for all samples."""
    distances = np.full(len(samples), float(distance))
    ends = np.array([0, len(samples)])
    return fit_all_within(samples, ends, distances, np.array([segments]), np.array([closed]))[0]
