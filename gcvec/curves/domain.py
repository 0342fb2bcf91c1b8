"""Boundary curves → parameter polygons Φ that hug their regions (paper, section 4.1).

The vertices of all polygons lie on the curves, at boundary samples: junctions, corners, and as many further
samples as the polygons need to stay within a tolerance of the curves and clear of each other. Neighbours
share them, so the polygons of all regions tile the image. Each polygon edge belongs to one stretch of one
curve, C_i.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.crossings import crossing_segments
from gcvec.curves.network import Network
from gcvec.kernels import kernel

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FINEST_LEVEL = 8
"""At this level a polygon goes through all samples of its curve: S moves none of them."""


def polygon_vertices(network: Network) -> NDArray[np.bool_]:
    """Which samples of the curves `(n,)` are vertices of the polygons.

    Douglas-Peucker to the tolerance of each curve's level; a closed curve has at least three edges.
    """
    sampling = network.sampling
    level = np.array([c.level for c in network.curves])
    tolerance = np.where(level < FINEST_LEVEL, 0.5**level, 0.0)
    fewest = np.where(network.family.closed, 3, 1)
    return np.asarray(_douglas_peucker(sampling.points, sampling.starts, fewest, tolerance))


def without_crossings(network: Network, changed: Iterable[int] | None = None) -> Network:
    """The network with levels raised until no polygon edges cross; curves must not cross themselves or
    others.

    Where only some curves' polygons have `changed` since none crossed, only those are looked at.
    """
    while True:
        bad = [c for c in crossing_curves(network, changed) if network.curves[c].level < FINEST_LEVEL]
        if not bad:
            return network
        network = raise_levels(network, bad)
        changed = None if changed is None else {*changed, *bad}


def with_levels(network: Network, level: int) -> Network:
    """The network with all parameter polygons at one level."""
    return network.at_levels([level] * len(network.curves))


def raise_levels(network: Network, which: Iterable[int]) -> Network:
    """The network with the polygons four times as close to these curves."""
    levels = [c.level for c in network.curves]
    for c in which:
        levels[c] = min(levels[c] + 2, FINEST_LEVEL)
    return network.at_levels(levels)


@kernel
def _chord_distance(points, a, b, p):
    """Distance of `points[p]` from the segment between `points[a]` and `points[b]`."""
    dx, dy = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    px, py = points[p, 0] - points[a, 0], points[p, 1] - points[a, 1]
    square = dx * dx + dy * dy
    t = min(max((px * dx + py * dy) / square, 0.0), 1.0) if square > 0 else 0.0
    return np.hypot(px - t * dx, py - t * dy)


@kernel
def _douglas_peucker(points, starts, fewest, tolerance):
    kept = np.zeros(len(points), np.bool_)
    stack = np.empty((len(points) + 3, 2), np.int64)
    for c in range(len(fewest)):
        first, length = starts[c], starts[c + 1] - starts[c] - 1
        for i in range(fewest[c]):
            stack[i, 0] = first + (i * length) // fewest[c]
            stack[i, 1] = first + ((i + 1) * length) // fewest[c]
            kept[stack[i, 0]] = kept[stack[i, 1]] = True
        top = fewest[c]
        while top > 0:
            top -= 1
            a, b = stack[top, 0], stack[top, 1]
            worst, where = tolerance[c], -1
            for p in range(a + 1, b):
                distance = _chord_distance(points, a, b, p)
                if distance > worst:
                    worst, where = distance, p
            if where >= 0:
                kept[where] = True
                stack[top, 0], stack[top, 1] = a, where
                stack[top + 1, 0], stack[top + 1, 1] = where, b
                top += 2
    return kept


def sample_numbers(network: Network) -> tuple[Ints, NDArray[np.bool_]]:
    """The number `(n,)` of each sample of the curves, nodes first, and which ones are the curve's own:
    open curves end in nodes, closed ones where they began."""
    sampling, closed, n_nodes = network.sampling, network.family.closed, network.n_nodes
    start = np.array([c.start for c in network.curves])
    end = np.array([c.end for c in network.curves])
    first, last = sampling.starts[:-1], sampling.starts[1:] - 1
    own = np.ones(len(sampling.u), bool)
    own[last] = False
    own[first[~closed]] = False
    number = np.empty(len(own), np.int64)
    number[own] = np.arange(n_nodes, n_nodes + own.sum())
    number[first[~closed]], number[last[~closed]] = start[~closed], end[~closed]
    number[last[closed]] = number[first[closed]]
    return number, own


def polygon_edges(network: Network) -> Ints:
    """Parameter polygon edges `(e, 2)` of all curves, from sample to sample of the curves."""
    vertex = np.flatnonzero(polygon_vertices(network))
    curve = network.sampling.curve[vertex]
    same = curve[:-1] == curve[1:]
    return np.stack([vertex[:-1][same], vertex[1:][same]], axis=1)


def crossing_curves(network: Network, among: Iterable[int] | None = None) -> Ints:
    """Curves with a polygon edge that meets another edge anywhere but in a common vertex.

    Only pairs of edges of which one belongs to the curves `among` are looked at, if these are given.
    """
    edges = polygon_edges(network)
    owner = network.sampling.curve[edges[:, 0]]
    places = network.sampling.points[edges]
    asked = np.ones(len(edges), bool)
    if among is not None:
        of_curve = np.zeros(len(network.curves), bool)
        of_curve[np.fromiter(among, np.int64)] = True
        asked = of_curve[owner]
    bad = crossing_segments(places, asked) | _touching(places, sample_numbers(network)[0][edges], asked)
    return np.unique(owner[bad])


def _touching(places: Floats, number: Ints, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which edges `(e,)` end in the same place `(e, 2, 2)` as one that is asked, or, themselves asked, as
    any, but in a vertex of another `number` `(e, 2)`."""
    x, y = places.reshape(-1, 2).T
    order = np.lexsort([number.ravel(), y, x])
    one, next_one = order[:-1], order[1:]
    apart = number.ravel()[one] != number.ravel()[next_one]
    here = np.flatnonzero((x[one] == x[next_one]) & (y[one] == y[next_one]) & apart)
    pairs = np.stack([one[here], next_one[here]], axis=1) // 2
    touching = np.zeros(len(places), bool)
    touching[pairs[asked[pairs].any(axis=1)]] = True
    return touching
