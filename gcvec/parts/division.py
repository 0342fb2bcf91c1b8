"""A foundation cut into parts along the borders of its regions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import OUTSIDE
from gcvec.curves.loops import network_loops
from gcvec.curves.network import Curve, Network
from gcvec.patches.canonical import Foundation
from gcvec.patches.color_space import color_space
from gcvec.patches.mesh import CELL_LEVELS, FINEST_CELL
from gcvec.raster.triangle import double_areas

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CELL = FINEST_CELL << CELL_LEVELS
"""Parts begin at multiples of this many pixels, so that they have the whole picture's free points."""


@dataclass(frozen=True)
class Part:
    """Some patches of a picture as a picture of their own, inside a frame of its own.

    network  the curves around them, from the frame's corner; what is not of the part counts as outside
    hard     (c,) bool, of each of these curves
    patches  (k,) the patches, as the whole picture numbers them
    colors   (b,) which boundary colour of the whole picture each boundary colour of the part is
    """

    network: Network
    hard: NDArray[np.bool_]
    patches: Ints
    colors: Ints

    @property
    def origin(self) -> Ints:
        """`(2,)` column and row where the frame begins."""
        return np.array(self.network.origin)


def divided(foundation: Foundation, n: int) -> list[Ints]:
    """The patches of a foundation in at most `n` groups that lie together and have about the same area."""
    mesh, n_patches = foundation.geometry.mesh, len(foundation.network.loops)
    corners = mesh.vertices[mesh.triangles]
    weight = np.abs(double_areas(mesh.vertices, mesh.triangles)) / 2
    area = np.bincount(mesh.patch, weight, n_patches).astype(np.float64)
    moment = [np.bincount(mesh.patch, weight * middle, n_patches) for middle in corners.mean(axis=1).T]
    return _split(np.arange(n_patches), np.stack(moment, axis=1) / area[:, None], area, n)


def _split(patches: Ints, centres: Floats, area: Floats, n: int) -> list[Ints]:
    """Cut across the longer side, again and again."""
    if n < 2 or len(patches) < 2:
        return [np.sort(patches)]
    side = int(np.ptp(centres[patches], axis=0).argmax())
    ordered = patches[np.argsort(centres[patches, side], kind="stable")]
    before = np.cumsum(area[ordered])
    wanted = before[-1] * (n // 2) / n
    cut = int(np.clip(np.searchsorted(before, wanted) + 1, 1, len(ordered) - 1))
    halves = (ordered[:cut], n // 2), (ordered[cut:], n - n // 2)
    return [group for half, share in halves for group in _split(half, centres, area, share)]


def part_of(foundation: Foundation, patches: Sequence[int] | Ints) -> Part:
    """The part of a foundation that consists of these patches."""
    network = foundation.network
    patches = np.asarray(patches, np.int64)
    number = np.full(len(network.loops) + 1, OUTSIDE)  # the last is the outside's, number -1
    number[patches] = np.arange(len(patches))
    kept = np.flatnonzero((number[network.sides] != OUTSIDE).any(axis=1))
    own = [network.curves[c] for c in kept]
    ends = np.array([(curve.start, curve.end) for curve in own])
    nodes = np.unique(ends[ends >= 0])
    ends = np.where(ends < 0, ends, np.searchsorted(nodes, ends))
    at = np.concatenate([np.arange(network.offsets[c], network.offsets[c + 1]) for c in kept])

    reach = network.control_points[at]
    begin = np.maximum(np.floor(reach.min(axis=0)), 0).astype(np.int64) // CELL * CELL
    size = (
        np.minimum(np.ceil(reach.max(axis=0)) + 1, [network.width, network.height]).astype(np.int64) - begin
    )
    curves = tuple(
        Curve(
            curve.control_points - begin,
            int(number[curve.left]),
            int(number[curve.right]),
            start,
            end,
            curve.level,
        )
        for curve, (start, end) in zip(own, ends.tolist(), strict=True)
    )
    width, height = size.tolist()
    x, y = begin.tolist()
    loops = network_loops(curves, len(patches))
    part = Network(width, height, len(nodes), curves, loops, (x, y))

    space = color_space(part, foundation.hard[kept])
    colors = np.empty(space.size, np.int64)
    used = space.of_control >= 0
    colors[space.of_control[used]] = foundation.space.of_control[:, at][used]
    return Part(part, foundation.hard[kept], patches, colors)
