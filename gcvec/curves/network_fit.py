"""Borders → the network of curves that the file will hold: on its grid, and crossing nowhere."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Border, Borders, between_nodes
from gcvec.borders.planar_graph import Loop
from gcvec.curves.domain import FINEST_LEVEL, crossing_curves, with_levels, without_crossings
from gcvec.curves.network import COARSEST_LEVEL, Network, fitted_curves
from gcvec.quantization import Quantization

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
    closeness = np.array(CLOSENESS)
    tries = np.zeros(len(traced.borders), np.int64)
    before = _Turns(localized.loops, traced)
    found = localized
    curves = fitted_curves(found.borders, closeness[tries], grid, FINEST_LEVEL)
    changed = np.arange(len(curves))
    while True:
        network = Network(found.width, found.height, len(found.nodes), tuple(curves), found.loops)
        wrong = np.union1d(crossing_curves(network, changed), _inside_out(network, traced, before))
        pending = wrong[tries[wrong] < len(CLOSENESS) - 1]
        if not len(pending):
            return without_crossings(with_levels(network, COARSEST_LEVEL))
        tries[pending] += 1
        last, found = found, _mixed(traced, localized, tries)
        moved = [k for k, (a, b) in enumerate(zip(last.borders, found.borders, strict=True)) if a is not b]
        changed = np.union1d(pending, np.array(moved, np.int64))
        again = fitted_curves(
            [found.borders[k] for k in changed], closeness[tries[changed]], grid, FINEST_LEVEL
        )
        for k, curve in zip(changed, again, strict=True):
            curves[k] = curve


class _Turns:
    """Which way round the loops of a picture run.

    border  (h,) the borders of all loops, one loop after another
    way     (h,) 1 where a loop follows the border forward, -1 where backward
    first   (l,) where each loop begins
    area    (l,) twice the signed area inside it
    """

    def __init__(self, loops: tuple[tuple[Loop, ...], ...], borders: Borders) -> None:
        """Borders that end beside their nodes, as where junctions were united, are taken as far as these."""
        walks = [loop for region in loops for loop in region]
        halves = np.array([half for loop in walks for half in loop], np.int64).reshape(-1, 2)
        self.border, self.way = halves[:, 0], 2 * halves[:, 1] - 1
        self.first = np.cumsum([0, *map(len, walks)])[:-1]
        rows = [between_nodes(border, borders.nodes).samples for border in borders.borders]
        self.area = self.areas(np.concatenate(rows), np.cumsum([0, *map(len, rows)]))

    def areas(self, points: Floats, starts: Ints) -> Floats:
        """Twice the signed areas `(l,)` for points `(n, 2)` on the borders, where `starts` `(b + 1,)`
        says."""
        x, y = points.T
        swept = x[:-1] * y[1:] - x[1:] * y[:-1]
        # Between two borders nothing is swept.
        swept[starts[1:-1] - 1] = 0.0
        of_border = np.add.reduceat(np.append(swept, 0.0), starts[:-1])
        return np.asarray(np.add.reduceat(self.way * of_border[self.border], self.first))


def _inside_out(network: Network, traced: Borders, before: _Turns) -> Ints:
    """Curves of loops that run round the other way than they were traced, as those of a pixel may."""
    sampling = network.sampling
    after = before.areas(sampling.points, sampling.starts)
    sizes = np.diff(np.append(before.first, len(before.border)))
    wrong = np.unique(before.border[np.repeat(after * before.area <= 0, sizes)])
    return np.array([k for k in wrong if not traced.borders[k].on_frame], np.int64)


def _mixed(traced: Borders, localized: Borders, tries: Ints) -> Borders:
    """Localized borders, but traced ones, nodes included, where the first tries failed."""
    nodes = localized.nodes.copy()
    chosen = list(localized.borders)
    back = np.flatnonzero(tries >= HALF_TRACED)
    meeting = _where_they_meet([localized.borders[k] for k in back])
    moved: set[int] = set()
    for k in back:
        border = traced.borders[k]
        ends = [] if border.closed else [border.start, border.end]
        bad = [node for node in ends if node in meeting]
        if tries[k] >= TRACED or len(bad) != 1:
            chosen[k], bad = border, ends
        else:
            chosen[k] = _half_traced(border, chosen[k], at_start=bad[0] == border.start)
        moved.update(bad)
    at = np.array(sorted(moved), np.int64)
    nodes[at] = traced.nodes[at]
    fitted = tuple(
        between_nodes(b, nodes) if tries[k] >= HALF_TRACED or b.start in moved or b.end in moved else b
        for k, b in enumerate(chosen)
    )
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
