"""Connected components of a map of owners, and what becomes of those too small to stand alone."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.disjoint_sets import join, set_numbers
from gcvec.kernels import kernel

SLIVER_AREA = 16
"""Components of fewer pixels are no regions."""


def connected_components(owners: NDArray[np.int32]) -> NDArray[np.int32]:
    """Number the 4-connected components of equal `owners (h, w)` from 0 in raster order of their
    first pixels. Pixels that touch at a corner only are not connected."""
    return np.asarray(_components(np.ascontiguousarray(owners)))


@kernel
def _components(owners):
    """Runs of equal owners are joined as they are met; what is joined goes by the number met first."""
    height, width = owners.shape
    labels = np.empty((height, width), np.int32)
    parent = np.empty(height * width, np.int32)
    count = 0
    for y in range(height):
        for x in range(width):
            left = x > 0 and owners[y, x - 1] == owners[y, x]
            above = y > 0 and owners[y - 1, x] == owners[y, x]
            if left:
                labels[y, x] = labels[y, x - 1]
                # Where the pixels above are joined too, so are these.
                if above and owners[y - 1, x - 1] != owners[y, x]:
                    join(parent, labels[y, x], labels[y - 1, x])
            elif above:
                labels[y, x] = labels[y - 1, x]
            else:
                labels[y, x] = parent[count] = count
                count += 1
    number = set_numbers(parent[:count])
    for y in range(height):
        for x in range(width):
            labels[y, x] = number[labels[y, x]]
    return labels


def bridge_slivers(owners: NDArray[np.int32], min_area: int = SLIVER_AREA) -> None:
    """Give components of fewer than `min_area` pixels that touch another of their owner at a corner a pixel
    beside it, in place: a line a pixel or two wide, drawn aslant, is one.

    Only owners >= 0 are given pixels, and only those of lower ones: what lies above stays whole.
    """
    labels = connected_components(owners)
    _bridge(owners, labels, np.bincount(labels.ravel()), min_area)


@kernel
def _bridge(owners, labels, areas, min_area):
    height, width = owners.shape
    for y in range(height - 1):
        for x in range(width - 1):
            for slope in range(2):
                own, one, other = owners[y, x + slope], labels[y, x + slope], labels[y + 1, x + 1 - slope]
                if own < 0 or owners[y + 1, x + 1 - slope] != own or one == other:
                    continue
                above, below = owners[y, x + 1 - slope], owners[y + 1, x + slope]
                if min(areas[one], areas[other]) >= min_area or above == own or below == own:
                    continue
                if above < own and above <= below:
                    owners[y, x + 1 - slope] = own
                elif below < own:
                    owners[y + 1, x + slope] = own


def absorb_slivers(owners: NDArray[np.int32], min_area: int = SLIVER_AREA) -> NDArray[np.int32]:
    """Give every component of fewer than `min_area` pixels to the owner it shares the longest border with.

    In every round each sliver, the smallest first, joins a neighbour unless a smaller one has joined it
    before; rounds end when no sliver is left, so several can grow into a component that stays. Where borders
    are equally long the neighbour of larger area takes it. Returns a new map. A picture smaller than
    `min_area` is one component.
    """
    owners = np.ascontiguousarray(owners).copy()
    while True:
        labels = connected_components(owners)
        areas = np.bincount(labels.ravel())
        is_sliver = areas < min_area
        if not is_sliver.any() or len(areas) == 1:
            return owners
        pixels = np.flatnonzero(is_sliver[labels])
        component = labels.ravel()[pixels]
        order = np.lexsort((component, areas[component]))
        starts = np.flatnonzero(np.diff(component[order], prepend=-1))
        _repaint(owners, labels, areas, pixels[order], np.append(starts, len(pixels)), min_area)


@kernel
def _repaint(
    owners: NDArray[np.int32],
    labels: NDArray[np.int32],
    areas: NDArray[np.int64],
    pixels: NDArray[np.int64],
    starts: NDArray[np.int64],
    min_area: int,
) -> None:
    """Repaint the slivers, flat indices `pixels[starts[i]:starts[i + 1]]`, one after another with the owner
    next to them; one that an earlier sliver has joined has grown and waits for the next round."""
    height, width = owners.shape
    candidates = np.empty(4 * min_area, dtype=np.int32)
    borders = np.empty(4 * min_area, dtype=np.int64)
    largest = np.empty(4 * min_area, dtype=np.int64)
    for i in range(len(starts) - 1):
        component = pixels[starts[i] : starts[i + 1]]
        own = owners[component[0] // width, component[0] % width]
        own_label = labels[component[0] // width, component[0] % width]
        count = 0
        grown = False
        for pixel in component:
            y, x = pixel // width, pixel % width
            for dy, dx in ((-1, 0), (0, -1), (0, 1), (1, 0)):
                v, u = y + dy, x + dx
                if v < 0 or u < 0 or v >= height or u >= width or labels[v, u] == own_label:
                    continue
                neighbour = owners[v, u]
                grown = grown or neighbour == own
                k = 0
                while k < count and candidates[k] != neighbour:
                    k += 1
                if k == count:
                    candidates[k], borders[k], largest[k] = neighbour, 0, 0
                    count += 1
                borders[k] += 1
                largest[k] = max(largest[k], areas[labels[v, u]])
        if grown:
            continue
        best = 0
        for k in range(1, count):
            if (borders[k], largest[k]) > (borders[best], largest[best]):
                best = k
        for pixel in component:
            owners[pixel // width, pixel % width] = candidates[best]
