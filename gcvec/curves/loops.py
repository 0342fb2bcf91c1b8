"""Boundary curves → the loops they form around each patch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import OUTSIDE, Loop
from gcvec.curves.network import Curve

_Half = tuple[int, bool]


def network_loops(curves: tuple[Curve, ...], n_patches: int) -> tuple[tuple[Loop, ...], ...]:
    """Loops of every patch, the patch at the right hand. `ValueError` where curves do not close.

    Where a patch touches itself at a node the walk takes the sharpest turn to the right, which stays at the
    same corner.
    """
    leaving: dict[tuple[int, int], list[_Half]] = {}
    halves: list[tuple[int, _Half]] = []
    for c, curve in enumerate(curves):
        for forward, patch in ((True, curve.right), (False, curve.left)):
            if patch == OUTSIDE:
                continue
            halves.append((patch, (c, forward)))
            if not curve.closed:
                leaving.setdefault((curve.start if forward else curve.end, patch), []).append((c, forward))
    loops: list[list[Loop]] = [[] for _ in range(n_patches)]
    done: set[_Half] = set()
    for patch, first in halves:
        if first in done:
            continue
        loop: list[_Half] = []
        half = first
        while half not in done:
            done.add(half)
            loop.append(half)
            curve = curves[half[0]]
            if curve.closed:
                break
            node = curve.end if half[1] else curve.start
            candidates = [h for h in leaving.get((node, patch), []) if h not in done or h == first]
            if not candidates:
                raise ValueError("curves that do not close around a patch")
            half = min(candidates, key=lambda h: _turn(curves, loop[-1], h))
        loops[patch].append(tuple(loop))
    if not all(loops):
        raise ValueError("a patch without a boundary")
    return tuple(tuple(patch_loops) for patch_loops in loops)


def _turn(curves: tuple[Curve, ...], arriving: _Half, leaving: _Half) -> float:
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
