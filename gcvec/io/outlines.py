"""Label map -> the outer outline of every region, and how deep it lies inside others."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import OUTSIDE, Arc, Loop, planar_graph
from gcvec.io.straightening import straightened


class Outline(NamedTuple):
    """The outer border of a region.

    `ring` is `(n, 2) float64`, clockwise on the screen: a polygon that holds the centres of just those pixels
    that belong to the region or to what it surrounds. Neighbours have the vertices between them in common.
    `box` is left, top, right and bottom of these pixels; `depth` is the number of regions that surround the
    region itself.
    """

    ring: NDArray[np.float64]
    box: tuple[int, int, int, int]
    depth: int


def outlines(labels: NDArray[np.int32]) -> list[Outline]:
    """One outline a region of `labels (h, w)`, whose regions are 4-connected and numbered in raster order.

    Filled in that order, or by depth, the outlines give the label map again: what surrounds a region has its
    first pixel above the region's own, so it comes before it.
    """
    graph = planar_graph(labels)
    lines = [straightened(arc.points) for arc in graph.arcs]
    areas = [_area(arc.points) for arc in graph.arcs]
    outer: list[Loop] = []
    surrounding: set[tuple[int, int]] = set()
    for region, loops in enumerate(graph.loops):
        for loop in loops:
            if sum(areas[arc] if forward else -areas[arc] for arc, forward in loop) > 0:
                outer.append(loop)
            else:
                surrounding.update((region, _beyond(graph.arcs[arc], forward)) for arc, forward in loop)

    found: list[Outline] = []
    for region, first in enumerate(np.unique(labels, return_index=True)[1].tolist()):
        y, x = divmod(first, labels.shape[1])
        above = int(labels[y - 1, x]) if y else OUTSIDE
        depth = 0 if above == OUTSIDE else found[above].depth + ((above, region) in surrounding)
        corners = np.concatenate([graph.arcs[arc].points for arc, _ in outer[region]])
        (left, top), (right, bottom) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
        sides = [lines[arc] if forward else lines[arc][::-1] for arc, forward in outer[region]]
        ring = np.concatenate([side[:-1] for side in sides])
        found.append(Outline(ring, (left, top, right, bottom), depth))
    return found


def _area(points: NDArray[np.int32]) -> int:
    """Twice the area that the way along the points sweeps, seen from the origin; positive if clockwise."""
    x, y = points.T.astype(np.int64)
    return int((x[:-1] * y[1:] - x[1:] * y[:-1]).sum())


def _beyond(arc: Arc, forward: bool) -> int:
    """The region at the other side, for the one that has the arc in a loop in this direction."""
    return arc.left if forward else arc.right
