"""Bottom-up merging of the regions of a picture by what the borders between them are worth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gcvec.components import SLIVER_AREA

_SATURATION = 4.0
"""A piece of border is worth at most this many times what it costs: beyond that points could do its work."""

_REGION_COST = 100.0
"""The smaller a region, the stronger its border must be: at this area, px², a border must pay twice."""

_BATCH = 20
"""Of this many regions one is merged before the borders are weighed again."""

_SLIVERS_FIRST = 1e3


@dataclass(frozen=True)
class Borders:
    """The borders between regions, one a pair: `first < second`, each `(k,)`, in ascending order of the pair.

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


def borders_between(
    origin: NDArray[np.int64], target: NDArray[np.int64], step: NDArray[np.float64]
) -> Borders:
    """The borders made of single cracks, each between the regions `origin (n,)` and `target (n,)`, with the
    colour step `(n, 3)` from the one to the other."""
    energy = np.square(step).mean(axis=1)
    excess = np.maximum(energy / _SATURATION, 1.0)
    step = step / np.sqrt(excess)[:, None]
    return _summed(origin, target, np.ones(len(origin)), energy / excess, step)


def merged(borders: Borders, areas: NDArray[np.int64], regions: int = 0) -> NDArray[np.int64]:
    """The group of every region, numbered from 0, after merging across the weakest borders.

    `areas (n,)` are the regions' pixels. Regions under `SLIVER_AREA` merge first. Merging ends when every
    border left is worth what it costs or, with `regions` > 0, when that many groups are left; the latter goes
    on past the former and ends short of it.
    """
    groups = np.arange(len(areas))
    while len(borders) and len(areas) > max(regions, 1):
        smaller = _smaller(borders, areas)
        gain = _gain(borders, areas[smaller])
        chosen = _weakest_of_smaller(borders, smaller, gain)
        most = max(len(areas) // _BATCH, 1)
        if regions:
            most = min(most, len(areas) - regions)
        else:
            chosen = chosen[gain[chosen] < 0]
        chosen = _smallest(gain, chosen, most)
        if not len(chosen):
            break
        joined = _joined(borders, chosen, len(areas))
        areas = np.bincount(joined, areas).astype(np.int64)
        groups = joined[groups]
        borders = _contracted(borders, joined)
    return groups


def _smaller(borders: Borders, areas: NDArray[np.int64]) -> NDArray[np.int64]:
    """The smaller region at each border; of equal ones the first."""
    return np.where(areas[borders.second] < areas[borders.first], borders.second, borders.first)


def _gain(borders: Borders, smaller_area: NDArray[np.int64]) -> NDArray[np.float64]:
    """What a border saves less what it costs, per pixel of its length.

    A step of one sign along the whole border counts in full; one whose sign changes, as between the
    grains of a texture, counts half.
    """
    mean_step = borders.step / borders.length[:, None]
    worth = (borders.energy / borders.length + np.square(mean_step).mean(axis=1)) / 2
    gain: NDArray[np.float64] = worth - 1 - _REGION_COST / smaller_area
    return gain - _SLIVERS_FIRST * (smaller_area < SLIVER_AREA)


def _weakest_of_smaller(
    borders: Borders, smaller: NDArray[np.int64], gain: NDArray[np.float64]
) -> NDArray[np.int64]:
    """The borders that are the weakest of all that the smaller of their regions has, one a region.

    So a small region between two large ones joins one of them and never both at once, and no cycle arises.
    """
    weakest = np.full(borders.second.max() + 1, np.inf)
    np.minimum.at(weakest, borders.first, gain)
    np.minimum.at(weakest, borders.second, gain)
    candidates = np.flatnonzero(gain == weakest[smaller])
    return candidates[np.unique(smaller[candidates], return_index=True)[1]]


def _smallest(values: NDArray[np.float64], indices: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """Those `count` of the indices that have the smallest values."""
    if count >= len(indices):
        return indices
    return indices[np.argpartition(values[indices], count)[:count]]


def _joined(borders: Borders, chosen: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """The new number of each region when those on both sides of the chosen borders become one."""
    ends = borders.first[chosen], borders.second[chosen]
    graph = coo_array((np.ones(len(chosen), dtype=np.int8), ends), shape=(count, count))
    return connected_components(graph, directed=False)[1].astype(np.int64)


def _contracted(borders: Borders, joined: NDArray[np.int64]) -> Borders:
    first, second = joined[borders.first], joined[borders.second]
    kept = first != second
    return _summed(first[kept], second[kept], borders.length[kept], borders.energy[kept], borders.step[kept])


def _summed(
    origin: NDArray[np.int64],
    target: NDArray[np.int64],
    length: NDArray[np.float64],
    energy: NDArray[np.float64],
    step: NDArray[np.float64],
) -> Borders:
    """One border a pair of regions, whichever of the two comes first."""
    if not len(origin):
        return Borders(origin, target, length, energy, step)
    step = np.where((origin < target)[:, None], step, -step)
    pair = np.minimum(origin, target) * (max(origin.max(), target.max()) + 1) + np.maximum(origin, target)
    order = np.argsort(pair, kind="stable")
    pair = pair[order]
    starts = np.flatnonzero(np.diff(pair, prepend=-1))
    first, second = np.divmod(pair[starts], max(origin.max(), target.max()) + 1)
    sums = (np.add.reduceat(values[order], starts, axis=0) for values in (length, energy, step))
    return Borders(first, second, *sums)
