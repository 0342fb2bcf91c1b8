"""Boundary curves → the loops they form around each patch."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import Half, Loop, walked_loops
from gcvec.curves.network import Curve


def network_loops(curves: tuple[Curve, ...], n_patches: int) -> tuple[tuple[Loop, ...], ...]:
    """Loops of every patch, the patch at the right hand. `ValueError` where curves do not close.

    Where a patch touches itself at a node the walk takes the sharpest turn to the right, which stays at the
    same corner.
    """
    return walked_loops(curves, n_patches, partial(_turn, curves))


def _turn(curves: tuple[Curve, ...], arriving: Half, leaving: Half) -> float:
    """Angle from turning back to the leaving direction, growing to the left: least is the sharpest right
    turn."""
    back = _tangent(curves[arriving[0]], not arriving[1])
    out = _tangent(curves[leaving[0]], leaving[1])
    angle = np.arctan2(back[0] * out[1] - back[1] * out[0], back @ out)
    return float(-angle % (2 * np.pi))


def _tangent(curve: Curve, forward: bool) -> NDArray[np.float64]:
    """Direction in which the curve leaves its start, or, backward, its end."""
    points = curve.control_points if forward else curve.control_points[::-1]
    apart = np.flatnonzero((points != points[0]).any(axis=1))
    return points[apart[0]] - points[0] if len(apart) else np.zeros(2)
