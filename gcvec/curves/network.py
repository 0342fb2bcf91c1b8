"""Borders → boundary curves: every border fitted once, shared by its two regions (paper, section 4.2).

A curve runs from node to node, or is a closed periodic spline where a border meets no node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Border
from gcvec.borders.planar_graph import OUTSIDE, Loop
from gcvec.curves import bspline
from gcvec.curves.sampling import Sampling, sampling
from gcvec.curves.spline_family import SplineFamily
from gcvec.curves.spline_fit import fit_all_within

Floats = NDArray[np.float64]

DISTANCE = 0.3
"""Largest distance of a curve from a sample of its border, pixels."""

SEGMENT_LENGTH = 24.0
"""No segment of a curve is longer than this, pixels: the colours along it share its knots."""

COARSEST_LEVEL = 2
"""Parameter polygons start within 2^-2 pixels of their curves."""


@dataclass(frozen=True)
class Curve:
    """One cubic B-spline with uniform knots between the regions `left` and `right` (-1: outside the image).

    `control_points` is `(k, 2) float64`, pixels; the first and last are the positions of the nodes `start`
    and `end` (-1 each for a closed, periodic curve). The parameter polygons of both regions stay within
    2^-`level` pixels of the curve.
    """

    control_points: Floats
    left: int
    right: int
    start: int
    end: int
    level: int = COARSEST_LEVEL

    @property
    def closed(self) -> bool:
        return self.start < 0

    @property
    def segments(self) -> int:
        return bspline.segments_of(self.control_points, self.closed)

    @property
    def on_frame(self) -> bool:
        return self.left == OUTSIDE or self.right == OUTSIDE

    def at_level(self, level: int) -> Curve:
        return Curve(self.control_points, self.left, self.right, self.start, self.end, level)


@dataclass(frozen=True)
class Network:
    """All boundary curves of a picture. `loops[r]` bounds region r; `n_nodes` counts junctions and
    corners.

    Where they bound only a part of a larger picture, `origin` is the column and row at which its frame
    begins there; its patches need not tile that.
    """

    width: int
    height: int
    n_nodes: int
    curves: tuple[Curve, ...]
    loops: tuple[tuple[Loop, ...], ...]
    origin: tuple[int, int] | None = None

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
        curves = tuple(c if c.level == level else c.at_level(level) for c, level in pairs)
        changed = replace(self, curves=curves)
        for shared in ("family", "control_points", "sides", "sampling"):
            changed.__dict__[shared] = getattr(self, shared)
        return changed


def fitted_curves(borders: Sequence[Border], closeness: Floats, grid: float, level: int) -> list[Curve]:
    """The curves of borders, each `closeness` `(b,)` times closer to it than usual; at infinity the samples
    are its control points.

    Control points lie on a grid of `grid` pixels, as a decoder will see them, so that the fit can count on
    it.
    """
    control: dict[int, Floats] = {}
    followed = []
    for k, border in enumerate(borders):
        if border.on_frame:
            continue
        if closeness[k] < np.inf:
            followed.append(k)
        elif border.closed:
            control[k] = _padded(border.samples[:-1], 3)
        else:
            control[k] = _padded(border.samples, 4)
    if followed:
        own = [borders[k] for k in followed]
        control |= zip(followed, _followed(own, closeness[followed]), strict=True)
    curves = []
    for k, border in enumerate(borders):
        if border.on_frame:
            ends = np.round(border.samples[[0, -1]] / grid) * grid
            points = straight_line(ends[0], ends[1], max(1, int(np.ceil(_length(border) / SEGMENT_LENGTH))))
        else:
            points = np.round(control[k] / grid) * grid
        curves.append(Curve(points, border.left, border.right, border.start, border.end, level))
    return curves


def _followed(borders: list[Border], closeness: Floats) -> list[Floats]:
    """Control points of curves that follow their borders, each so many times closer than usual."""
    samples = np.concatenate([border.samples for border in borders])
    starts = np.cumsum([0, *(len(border.samples) for border in borders)])
    distances = np.repeat(DISTANCE / closeness, np.diff(starts))
    run = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(samples, axis=0).T))])
    lengths = run[starts[1:] - 1] - run[starts[:-1]]
    segments = np.maximum(1, np.ceil(lengths / SEGMENT_LENGTH).astype(np.int64))
    closed = np.array([border.closed for border in borders])
    return fit_all_within(samples, starts, distances, segments, closed)


def _length(border: Border) -> float:
    return float(np.hypot(*np.diff(border.samples, axis=0).T).sum())


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
