"""Bottom-up merging of the regions of a picture by what the borders between them are worth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.disjoint_sets import united
from gcvec.kernels import kernel
from gcvec.regions.components import SLIVER_AREA

_SATURATION = 4.0
"""A piece of border is worth at most this many times what it costs: beyond that points could do its work."""

_REGION_COST = 100.0
"""The smaller a region, the stronger its border must be: at this area, px², a border must pay twice."""

_ENDS = 3.0
"""So many cracks of a border cost nothing. Joining regions that all but touch at a corner, as the squares of
a chessboard do, saves no border: what lies beside their bridge stays."""

_BATCH = 20
"""Of this many regions one is merged before the borders are weighed again."""

_SLIVERS_FIRST = 1e3
"""Taken from the gain of a sliver's border: more than any border is worth, so slivers merge before others."""

_LIGHT, _OVERLOAD = 0.1, 1.3
"""Regions with no more than this share of the load that a group may have join even one that is full, up to so
many times that load: else they would be left over between groups."""


@dataclass(frozen=True)
class AdjacencyGraph:
    """The region adjacency graph: an edge for each pair of regions with a border in common, `first < second`,
    `(k,)` each, in ascending order.

    `length (k,)` counts the cracks of a border; `energy (k,)` sums over them the squared colour step across,
    mean over the channels, `step (k, 3)` the step itself, from `first` to `second`. Steps are in units of the
    step that is just worth a border.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    length: NDArray[np.float64]
    energy: NDArray[np.float64]
    step: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.first)


def adjacency_graph(
    origin: NDArray[np.int64], target: NDArray[np.int64], step: NDArray[np.float64]
) -> AdjacencyGraph:
    """The graph that comes of single cracks, each between the regions `origin (n,)` and `target (n,)`, with
    the colour step `(n, 3)` from the one to the other."""
    energy = np.square(step).mean(axis=1)
    excess = np.maximum(energy / _SATURATION, 1.0)
    step = step / np.sqrt(excess)[:, None]
    n = int(max(origin.max(initial=-1), target.max(initial=-1))) + 1
    return AdjacencyGraph(*summed(origin, target, np.ones(len(origin)), energy / excess, step, n))


def merged(
    graph: AdjacencyGraph,
    areas: NDArray[np.int64],
    regions: int = 0,
    load: NDArray[np.float64] | None = None,
    most_load: float = np.inf,
    most_border: float = np.inf,
) -> NDArray[np.int64]:
    """The group of every region, numbered from 0, after merging across the weakest borders.

    `areas (n,)` are the regions' pixels. Regions under `SLIVER_AREA` merge first, and none is left. Merging
    ends when every border left is worth what it costs or, with `regions` > 0, when no more than that many
    groups are left; the latter goes on past the former and ends short of it. The former goes on, too, while
    there are more than `most_border` cracks of border. Groups whose `load (n,)` would come to more than
    `most_load` stay apart; a small region that belongs to a full group joins it at the end, rather than
    another across an edge.
    """
    load = np.zeros(len(areas)) if load is None else load
    groups, now = np.arange(len(areas)), _Regions(graph, areas, load)
    while len(now.graph):
        chosen = _next_borders(now, regions, most_load, most_border)
        if not len(chosen):
            break
        joined = united(now.graph.first[chosen], now.graph.second[chosen], len(now.areas))
        groups, now = joined[groups], now.joined(joined)
    return groups


@dataclass(frozen=True)
class _Regions:
    """The regions that there are between two rounds of merging, with their pixels and loads, `(n,)` each."""

    graph: AdjacencyGraph
    areas: NDArray[np.int64]
    load: NDArray[np.float64]

    def joined(self, group: NDArray[np.int64]) -> _Regions:
        """The regions that come of joining those of one `group (n,)`."""
        graph = self.graph
        areas = np.bincount(group, self.areas).astype(np.int64)
        load = np.bincount(group, self.load).astype(np.float64)
        first, second = group[graph.first], group[graph.second]
        columns = summed(first, second, graph.length, graph.energy, graph.step, len(areas))
        return _Regions(AdjacencyGraph(*columns), areas, load)


class _Weighed(NamedTuple):
    """The borders of a graph, weighed, `(k,)` each.

    smaller  the smaller region at each, which is the one that joins the other
    gain     what the border is worth beyond its cost (`border_gains`)
    full     whether joining across it would come to more than a group may hold
    detour   whether the smaller region belongs to a full group rather than across it
    """

    smaller: NDArray[np.int64]
    gain: NDArray[np.float64]
    full: NDArray[np.bool_]
    detour: NDArray[np.bool_]


def _next_borders(now: _Regions, regions: int, most_load: float, most_border: float) -> NDArray[np.int64]:
    """The borders to merge across before all are weighed again: none where merging ends."""
    borders, n = _weighed(now, most_load), len(now.areas)
    batch = max(n // _BATCH, 1)
    chosen, gain = _weakest(now, borders, ~(borders.full | borders.detour))
    if regions and n > regions:
        return _smallest(gain, chosen, min(batch, n - regions))
    if regions:
        sliver = now.areas[borders.smaller[chosen]] < SLIVER_AREA
        return _smallest(gain[sliver], chosen[sliver], batch)
    enough = 0.0 if now.graph.length.sum() <= most_border else np.inf
    if not (gain < enough).any():
        chosen, gain = _weakest(now, borders, _left_over(now, borders))
    return _smallest(gain[gain < enough], chosen[gain < enough], batch)


def _weighed(now: _Regions, most_load: float) -> _Weighed:
    graph, areas = now.graph, now.areas
    smaller, gain = border_gains(graph.first, graph.second, graph.length, graph.energy, graph.step, areas)
    loads = np.stack([now.load[graph.first], now.load[graph.second]])
    allowed = np.where(loads.min(axis=0) <= _LIGHT * most_load, _OVERLOAD, 1) * most_load
    full = (loads.sum(axis=0) > allowed) & (areas[smaller] >= SLIVER_AREA)
    return _Weighed(smaller, gain, full, _detours(smaller, gain, full, areas))


def _weakest(
    now: _Regions, borders: _Weighed, allowed: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """For each region whose weakest border, of those `allowed (k,)`, it is the smaller one at: that border,
    and what it is worth, infinite where none is allowed."""
    gain = np.where(allowed, borders.gain, np.inf)
    chosen = weakest_of_smaller(now.graph.first, now.graph.second, borders.smaller, gain, len(now.areas))
    return chosen, gain[chosen]


def _left_over(now: _Regions, borders: _Weighed) -> NDArray[np.bool_]:
    """The borders `(k,)` of regions left over between full groups and edges: they are small."""
    lost = np.zeros(len(now.areas), np.bool_)
    lost[borders.smaller[borders.detour]] = True
    return lost[borders.smaller]


def _detours(
    smaller: NDArray[np.int64], gain: NDArray[np.float64], full: NDArray[np.bool_], areas: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """The borders that would pay twice but for the area of the smaller region, where the weakest border of
    that leads into a full group."""
    weakest = np.full(len(areas), np.inf)
    np.minimum.at(weakest, smaller[full], gain[full])
    pays = gain + _REGION_COST / areas[smaller] > 1
    return pays & ~full & (gain > weakest[smaller])


@kernel
def border_gains(first, second, length, energy, step, areas):
    """The smaller region at each border, of equal ones the first, and what the border saves less what it
    costs, per crack of its length, but for the first few.

    A step of one sign along the whole border counts in full; one whose sign changes, as between the grains of
    a texture, counts half.
    """
    smaller, gain = np.empty(len(first), np.int64), np.empty(len(first))
    for k in range(len(first)):
        smaller[k] = second[k] if areas[second[k]] < areas[first[k]] else first[k]
        area = areas[smaller[k]]
        square = 0.0
        for c in range(3):
            square += (step[k, c] / length[k]) ** 2 / 3
        gain[k] = (energy[k] / length[k] + square) / 2 - 1 + _ENDS / length[k] - _REGION_COST / area
        if area < SLIVER_AREA:
            gain[k] -= _SLIVERS_FIRST
    return smaller, gain


@kernel
def weakest_of_smaller(first, second, smaller, gain, n):
    """The borders that are the weakest of all that the smaller of their regions has, one a region.

    So a small region between two large ones joins one of them and never both at once, and no cycle arises.
    """
    weakest = np.full(n, np.inf)
    for k in range(len(first)):
        weakest[first[k]] = min(weakest[first[k]], gain[k])
        weakest[second[k]] = min(weakest[second[k]], gain[k])
    of_region = np.full(n, -1, np.int64)
    for k in range(len(first)):
        if gain[k] == weakest[smaller[k]] and of_region[smaller[k]] < 0:
            of_region[smaller[k]] = k
    return of_region[of_region >= 0]


def _smallest(values: NDArray[np.float64], indices: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Those `count` of the indices `(n,)` that have the smallest values `(n,)`."""
    if count >= len(indices):
        return indices
    return indices[np.argpartition(values, count)[:count]]


@kernel
def summed(origin, target, length, energy, step, n):
    """One border a pair of different regions, whichever of the two comes first: the columns of
    `AdjacencyGraph`."""
    low, high = np.minimum(origin, target), np.maximum(origin, target)
    order = _by(low, _by(high, np.flatnonzero(origin != target), n), n)
    first, second = np.empty(len(order), np.int64), np.empty(len(order), np.int64)
    lengths, energies, steps = np.empty(len(order)), np.empty(len(order)), np.empty((len(order), 3))
    last = -1
    for k in order:
        if last < 0 or first[last] != low[k] or second[last] != high[k]:
            last += 1
            first[last], second[last] = low[k], high[k]
            lengths[last], energies[last], steps[last] = 0.0, 0.0, 0.0
        lengths[last] += length[k]
        energies[last] += energy[k]
        for c in range(3):
            steps[last, c] += step[k, c] if origin[k] < target[k] else -step[k, c]
    n = last + 1
    return first[:n], second[:n], lengths[:n], energies[:n], steps[:n]


@kernel
def _by(keys, indices, n):
    """The indices in the order of their keys, each below n; those of one key stay in their order."""
    starts = np.zeros(n + 1, np.int64)
    for k in indices:
        starts[keys[k] + 1] += 1
    for key in range(n):
        starts[key + 1] += starts[key]
    ordered = np.empty(len(indices), np.int64)
    for k in indices:
        ordered[starts[keys[k]]] = k
        starts[keys[k]] += 1
    return ordered
