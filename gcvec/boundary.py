"""Borders → boundary curves: every border fitted once, shared by its two regions (paper, section 4.2).

A curve runs from node to node, or is a closed periodic spline where a border meets no node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gcvec import bspline
from gcvec.borders import Border, Loop
from gcvec.planar_graph import OUTSIDE
from gcvec.sampling import Sampling, sampling
from gcvec.spline_family import SplineFamily

Floats = NDArray[np.float64]

DISTANCE, SOFT_DISTANCE = 0.45, 0.6
"""Largest distances of a curve from samples of its border that the photo shows, and from those it does not,
pixels."""

SEGMENT_LENGTH = 24.0
"""No segment of a curve is longer than this, pixels: the colours along it share its knots."""


@dataclass(frozen=True)
class Curve:
    """One cubic B-spline with uniform knots between the regions `left` and `right` (-1: outside the image).

    `control_points` is `(k, 2) float64`, pixels; the first and last are the positions of the nodes `start`
    and `end` (-1 each for a closed, periodic curve). The parameter polygons of both regions stay within
    2^-`level` pixels of
    the curve.
    """

    control_points: Floats
    left: int
    right: int
    start: int
    end: int
    level: int = 2

    @property
    def closed(self) -> bool:
        return self.start < 0

    @property
    def segments(self) -> int:
        return bspline.segments_of(self.control_points, self.closed)

    @property
    def on_frame(self) -> bool:
        return self.left == OUTSIDE or self.right == OUTSIDE


@dataclass(frozen=True)
class Network:
    """All boundary curves of a picture. `loops[r]` bounds region r; `n_nodes` counts junctions and
    corners."""

    width: int
    height: int
    n_nodes: int
    curves: tuple[Curve, ...]
    loops: tuple[tuple[Loop, ...], ...]

    @cached_property
    def family(self) -> SplineFamily:
        """All curves as one family of splines."""
        counts = [len(curve.control_points) for curve in self.curves]
        return SplineFamily(np.cumsum([0, *counts]), np.array([c.closed for c in self.curves]))

    @cached_property
    def control_points(self) -> Floats:
        """`(c, 2)` control points of all curves, one curve after another."""
        return np.concatenate([curve.control_points for curve in self.curves])

    @property
    def offsets(self) -> NDArray[np.int64]:
        """`(curves + 1,)` where each curve's control points begin in them."""
        return self.family.offsets

    @cached_property
    def sides(self) -> NDArray[np.int64]:
        """`(curves, 2)` the regions right and left of each curve."""
        return np.array([(c.right, c.left) for c in self.curves])

    @cached_property
    def sampling(self) -> Sampling:
        """The samples through which the curves meet meshes, whatever their levels."""
        return sampling(self.family, self.control_points)

    def at_levels(self, levels: Sequence[int]) -> Network:
        """The network with the parameter polygons of every curve within 2^-level pixels of it."""
        pairs = zip(self.curves, levels, strict=True)
        curves = tuple(c if c.level == level else replace(c, level=level) for c, level in pairs)
        changed = replace(self, curves=curves)
        for shared in ("family", "control_points", "sides", "sampling"):
            changed.__dict__[shared] = getattr(self, shared)
        return changed


def fitted_curve(border: Border, closeness: float = 1.0) -> Curve:
    """The curve of one border, so many times closer to it than usual; at infinity the samples are its control
    points."""
    return Curve(_fitted(border, closeness), border.left, border.right, border.start, border.end)


def _fitted(border: Border, closeness: float) -> Floats:
    samples = border.samples
    length = float(np.hypot(*np.diff(samples, axis=0).T).sum())
    segments = max(1, int(np.ceil(length / SEGMENT_LENGTH)))
    if border.on_frame:
        return straight_line(samples[0], samples[-1], segments)
    if closeness == np.inf:
        return _padded(samples[:-1], 3) if border.closed else _padded(samples, 4)
    distances = (SOFT_DISTANCE + (DISTANCE - SOFT_DISTANCE) * border.trust) / closeness
    return bspline.fit_within(samples, distances, segments, border.closed)


def _padded(points: Floats, fewest: int) -> Floats:
    """The points, with mid-points put in until there are enough to be control points."""
    while len(points) < fewest:
        points = np.insert(points, 1, (points[0] + points[1]) / 2, axis=0)
    return points


def straight_line(a: Floats, b: Floats, segments: int) -> Floats:
    """Control points of the straight line from `a` to `b`, at uniform speed (Greville abscissae)."""
    knots = np.clip(np.arange(segments + 7) - 3, 0, segments)
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / (3 * segments)
    return np.asarray(a + greville[:, None] * (np.asarray(b) - a))
