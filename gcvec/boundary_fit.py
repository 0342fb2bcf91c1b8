"""Borders → the network of curves that the file will hold: on its grid, and crossing nowhere."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders import Border, Borders, between_nodes
from gcvec.boundary import Network, fitted_curve
from gcvec.domain import FINEST_LEVEL, crossing_curves, with_levels, without_crossings
from gcvec.quantization import Quantization, rounded_curve

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GRID = Quantization().grid

CLOSENESS = (1.0, 2.5, 1.0, 1.0, 2.0, 4.0, np.inf)
"""How closely a curve follows its border, try after try."""

HALF_TRACED, TRACED = 2, 3
"""From these tries on the border is that of the label map, not of the photo: first near the node where it
meets another such border, then all of it."""

NEAR_NODE = 10
"""Samples next to a node that go back with it."""


def fitted_network(traced: Borders, localized: Borders, grid: float = GRID) -> Network:
    """Curves through the localized borders, on a grid of `grid` pixels, with the levels of their parameter
    polygons.

    Curves that cross themselves or others, as they may around regions a pixel or two wide, are drawn closer
    to their borders, then go back to them as they were traced and follow those ever more closely.
    """
    tries = np.zeros(len(traced.borders), np.int64)
    found = localized
    curves = [rounded_curve(fitted_curve(border), grid) for border in found.borders]
    changed = np.arange(len(curves))
    while True:
        network = with_levels(
            Network(found.width, found.height, len(found.nodes), tuple(curves), found.loops), FINEST_LEVEL
        )
        wrong = np.union1d(crossing_curves(network, changed), _inside_out(network, traced))
        pending = wrong[tries[wrong] < len(CLOSENESS) - 1]
        if not len(pending):
            return without_crossings(replace(network, curves=tuple(curves)))
        tries[pending] += 1
        before, found = found, _mixed(traced, localized, tries)
        changed = np.array(
            [
                k
                for k, (old, new) in enumerate(zip(before.borders, found.borders, strict=True))
                if k in pending or not np.array_equal(old.samples, new.samples)
            ]
        )
        for k in changed:
            curves[k] = rounded_curve(fitted_curve(found.borders[k], CLOSENESS[tries[k]]), grid)


def _inside_out(network: Network, traced: Borders) -> Ints:
    """Curves of loops that run round the other way than they were traced, as those of a pixel may."""
    sampling = network.sampling
    drawn = [_swept(sampling.points[sampling.of_curve(c)]) for c in range(len(network.curves))]
    before = [_swept(border.samples) for border in traced.borders]
    wrong: set[int] = set()
    for loop in (loop for region in network.loops for loop in region):
        turns = [(k, 1 if forward else -1) for k, forward in loop]
        if sum(way * drawn[k] for k, way in turns) * sum(way * before[k] for k, way in turns) <= 0:
            wrong |= {k for k, _ in turns if not traced.borders[k].on_frame}
    return np.array(sorted(wrong), np.int64)


def _swept(points: Floats) -> float:
    """Twice the area that the way through the points sweeps as seen from the origin."""
    x, y = points.T
    return float(x[:-1] @ y[1:] - x[1:] @ y[:-1])


def _mixed(traced: Borders, localized: Borders, tries: Ints) -> Borders:
    """Localized borders, but traced ones, nodes included, where the first tries failed."""
    nodes = localized.nodes.copy()
    chosen = list(localized.borders)
    meeting = _where_they_meet([localized.borders[k] for k in np.flatnonzero(tries >= HALF_TRACED)])
    for k in np.flatnonzero(tries >= HALF_TRACED):
        border = traced.borders[k]
        ends = [] if border.closed else [border.start, border.end]
        bad = [node for node in ends if node in meeting]
        if tries[k] >= TRACED or len(bad) != 1:
            chosen[k], bad = border, ends
        else:
            chosen[k] = _half_traced(border, chosen[k], at_start=bad[0] == border.start)
        nodes[bad] = traced.nodes[bad]
    fitted = tuple(between_nodes(border, nodes) for border in chosen)
    return Borders(traced.width, traced.height, nodes, fitted, traced.loops)


def _where_they_meet(some: list[Border]) -> set[int]:
    """Nodes in which two of these borders end."""
    ends = Counter(node for border in some if not border.closed for node in (border.start, border.end))
    return {node for node, times in ends.items() if times > 1}


def _half_traced(traced: Border, localized: Border, at_start: bool) -> Border:
    """The localized border, traced next to its start or its end."""
    n = min(NEAR_NODE, len(traced.samples) // 2)
    near = np.arange(len(traced.samples)) < n
    near = near if at_start else near[::-1]
    samples = np.where(near[:, None], traced.samples, localized.samples)
    return replace(localized, samples=samples)
