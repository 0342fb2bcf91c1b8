"""Parameter domains and points → the canonical triangle mesh.

All domains tile the image, so one constrained Delaunay triangulation holds the meshes of all patches. Its
vertices are, in this order, the boundary samples, the control points, and free (Steiner) points where there
is a lot of room.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.network import Network
from gcvec.kernels import kernel
from gcvec.morphology import dilated_by_square
from gcvec.patches.samples import BoundarySamples
from gcvec.patches.triangulation import patch_triangulation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FINEST_CELL = 16
CELL_LEVELS = 4
"""Free points stand in the middle of clear quadtree cells of 16 to 256 pixels."""


@dataclass(frozen=True)
class Mesh:
    """Triangulated parameter domains of all patches.

    vertices   (v, 2) float64, pixels: `n_samples` boundary samples, `n_points` control points, free points
    triangles  (t, 3) int64, positive area in image coordinates
    patch      (t,) int64, the patch a triangle belongs to
    """

    vertices: Floats
    triangles: Ints
    patch: Ints
    n_samples: int
    n_points: int

    @property
    def first_free(self) -> int:
        return self.n_samples + self.n_points

    @cached_property
    def patch_of_vertices(self) -> Ints:
        """`(v,)` the patch of every interior vertex; of boundary samples, one of those beside them."""
        patch = np.zeros(len(self.vertices), np.int64)
        patch[self.triangles] = self.patch[:, None]
        return patch


def patch_mesh(mesh: Mesh, patch: int) -> tuple[Mesh, Ints]:
    """The mesh of one patch, and the vertices `(k,)` it keeps: all boundary samples, its interior ones."""
    own = mesh.triangles[mesh.patch == patch]
    interior = np.unique(own[own >= mesh.n_samples])
    kept = np.concatenate([np.arange(mesh.n_samples), interior])
    number = np.full(len(mesh.vertices), -1)
    number[kept] = np.arange(len(kept))
    n_points = int((interior < mesh.first_free).sum())
    part = Mesh(mesh.vertices[kept], number[own], np.full(len(own), patch), mesh.n_samples, n_points)
    return part, kept


def jitter(points: NDArray[np.int64], origin: tuple[int, int] = (0, 0)) -> Floats:
    """Positions `(n, 2)` in the parameter domain of the control points of pixels `(n, 2)` (x, y).

    A control point sits at its pixel's centre, moved by less than a twentieth of a pixel by a hash of the
    pixel's coordinates, so that no four of them lie on one circle and the Delaunay triangulation is unique.
    In a part of a picture that begins at `origin` they are those of the whole.
    """
    begin = np.array(origin, np.int64)
    return np.asarray(_jitter(np.asarray(points, np.int64) + begin) - begin)


@kernel
def jittered(x, y):
    """The position of one control point."""
    mask = np.uint64(0xFFFFFFFF)
    h = (np.uint64(x) * np.uint64(0x9E3779B1) + np.uint64(y) * np.uint64(0x85EBCA77)) & mask
    h = ((h ^ (h >> np.uint64(15))) * np.uint64(0x2C1B3C6D)) & mask
    h = ((h ^ (h >> np.uint64(12))) * np.uint64(0x297A2D39)) & mask
    h = h ^ (h >> np.uint64(15))
    across, down = np.int64(h & np.uint64(0xFFFF)), np.int64(h >> np.uint64(16))
    return x + 0.5 + 0.1 * (across / 65536 - 0.5), y + 0.5 + 0.1 * (down / 65536 - 0.5)


@kernel
def _jitter(points):
    result = np.empty(points.shape)
    for i in range(len(points)):
        result[i, 0], result[i, 1] = jittered(points[i, 0], points[i, 1])
    return result


def free_points(sites: Floats, width: int, height: int, origin: tuple[int, int] = (0, 0)) -> Floats:
    """Steiner points `(n, 2)` graded by the distance to the nearest of the `sites` `(k, 2)`.

    A quadtree cell is clear when no site lies in it or its eight neighbours. Every clear cell without a clear
    parent gets a point in its middle. Cells and the test are integers, so the points are the same everywhere.
    In a part of a picture they are those of the whole, if its `origin` is one of the coarsest cells.
    """
    size = FINEST_CELL
    columns, rows = -(-width // size), -(-height // size)
    side = 1 << CELL_LEVELS
    columns, rows = -(-columns // side) * side, -(-rows // side) * side
    taken: NDArray[np.bool_] = np.zeros((rows, columns), bool)
    x = np.clip((sites[:, 0] // size).astype(np.int64), 0, columns - 1)
    y = np.clip((sites[:, 1] // size).astype(np.int64), 0, rows - 1)
    taken[y, x] = True
    clear = [~dilated_by_square(taken)]
    for _ in range(CELL_LEVELS):
        taken = np.asarray(taken.reshape(len(taken) // 2, 2, -1, 2).any(axis=(1, 3)))
        clear.append(~dilated_by_square(taken))
    found = []
    parent_clear = np.zeros((0, 0), bool)
    for level in range(CELL_LEVELS, -1, -1):
        here = clear[level]
        if level < CELL_LEVELS:
            covered = np.repeat(np.repeat(parent_clear, 2, axis=0), 2, axis=1)
            points, parent_clear = here & ~covered, here | covered
        else:
            points, parent_clear = here, here
        ys, xs = np.nonzero(points)
        cell = size << level
        centre = np.stack([xs, ys], axis=1) * cell + cell // 2
        found.append(centre[(centre[:, 0] < width) & (centre[:, 1] < height)])
    return jitter(np.concatenate(found), origin)


def build_mesh(network: Network, samples: BoundarySamples, points: NDArray[np.int64]) -> Mesh:
    """The canonical mesh of a picture with control points at pixels `points` `(n, 2)`."""
    origin = network.origin or (0, 0)
    sites = np.concatenate([samples.domain, jitter(points, origin)])
    sites = np.concatenate([sites, free_points(sites, network.width, network.height, origin)])
    sides = network.sides[samples.segment_curve]
    triangles, patch = patch_triangulation(sites, samples.segments, sides, network.height)
    if network.origin is not None:
        sites, triangles = _used(sites, triangles, len(samples) + len(points))
    return Mesh(sites, triangles, patch, len(samples), len(points))


def _used(sites: Floats, triangles: Ints, first_free: int) -> tuple[Floats, Ints]:
    """The vertices without the free ones that no triangle has, and the triangles with the new numbers."""
    used = np.arange(len(sites)) < first_free
    used[triangles] = True
    return sites[used], (np.cumsum(used) - 1)[triangles]
