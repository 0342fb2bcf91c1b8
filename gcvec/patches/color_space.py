"""The unknown colours of a picture, and the operator that takes them to the corners of drawn triangles.

Unknowns, in this order: one colour for every patch at every node; the inner control points of every curve,
one set on a soft curve, two on a hard one; the interior control points. At a node the two patches beside a
soft curve share their colour.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.borders.planar_graph import OUTSIDE
from gcvec.curves.network import Network
from gcvec.disjoint_sets import united
from gcvec.kernels import bare_kernel, kernel
from gcvec.patches.drawing import Drawing
from gcvec.patches.mesh import Mesh
from gcvec.patches.patch import Blend
from gcvec.patches.samples import BoundarySamples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

RIGHT, LEFT = 0, 1


@dataclass(frozen=True)
class ColorSpace:
    """Numbering of the boundary colours of a network.

    size       number of boundary unknowns
    of_control (2, c) unknown of every control point of every curve, for the right and the left side;
               -1 outside the image
    node_keys  (k,) sorted `node * n_patches + patch`
    of_node    (k,) unknown of each of them
    """

    size: int
    of_control: Ints
    node_keys: Ints
    of_node: Ints
    n_patches: int

    def operator(
        self, network: Network, samples: BoundarySamples, drawing: Drawing, mesh: Mesh, blend: Blend
    ) -> tuple[sparse.csr_array, Ints]:
        """R `(n, unknowns)` from unknowns to colours, and which colour `(t, 3)` each corner of a triangle
        has.

        The colours are those of the control points, of the free vertices, and of every pair of boundary
        vertex and patch in use. `ValueError` for a patch that lies beside none of its curves.
        """
        left = network.sides[:, 1]
        index, vertex, patch = boundary_corners(
            drawing.triangles, drawing.patch, drawing.n_samples, drawing.n_vertices
        )
        n_own = int(np.searchsorted(vertex, drawing.n_samples))
        own = self._of_samples(left, samples, vertex[:n_own], patch[:n_own])
        between = self._of_points_between(left, samples, drawing, vertex[n_own:], patch[n_own:])

        n_points = mesh.n_points
        owner = np.repeat(np.arange(len(network.curves)), np.diff(network.offsets))
        parts = blend.boundary, blend.points
        filled = n_points + sum(part.nnz for part in parts)
        columns = np.empty(filled + own[0].size + between[0].size, np.int32)
        values = np.empty(len(columns))
        columns[:n_points], values[:n_points] = self.size + np.arange(n_points), 1
        _mix_free(
            *((part.indptr, part.indices, part.data) for part in parts),
            mesh.patch_of_vertices[mesh.first_free :],
            left[owner],
            self.of_control,
            self.size,
            columns[n_points:],
            values[n_points:],
        )
        columns[filled:] = np.concatenate([own[0].ravel(), between[0].ravel()])
        values[filled:] = np.concatenate([own[1].ravel(), between[1].ravel()])
        if (columns == OUTSIDE).any():
            raise ValueError("curves that do not lie beside their patches")
        free_start = n_points + blend.boundary.indptr + blend.points.indptr
        lengths = np.repeat([own[0].shape[1], between[0].shape[1]], [len(own[0]), len(between[0])])
        start = np.concatenate([np.arange(n_points), free_start, filled + np.cumsum(lengths)])
        shape = (len(start) - 1, self.size + n_points)
        return sparse.csr_array((values, columns, start.astype(np.int32)), shape=shape), index

    def _of_samples(
        self, left: Ints, samples: BoundarySamples, vertex: Ints, patch: Ints
    ) -> tuple[Ints, Floats]:
        """Unknowns `(k, 4)` and weights of the colours of samples in patches; `left` is that of curves."""
        curve = samples.curve[vertex]
        side = np.where(left[curve] == patch, LEFT, RIGHT)
        unknown = self.of_control[side[:, None], samples.control[vertex]]
        at_node = curve < 0
        key = vertex[at_node] * self.n_patches + patch[at_node]
        unknown[at_node] = self.of_node[np.searchsorted(self.node_keys, key)][:, None]
        return unknown, samples.weight[vertex]

    def _of_points_between(
        self, left: Ints, samples: BoundarySamples, drawing: Drawing, vertex: Ints, patch: Ints
    ) -> tuple[Ints, Floats]:
        """Unknowns `(k, 8)` and weights of the colours of tessellation points in patches."""
        row = vertex - drawing.n_samples
        ends, along = drawing.ends[row], drawing.along[row][:, None]
        start, end = (self._of_samples(left, samples, ends[:, k], patch) for k in (0, 1))
        weight = np.concatenate([(1 - along) * start[1], along * end[1]], axis=1)
        return np.concatenate([start[0], end[0]], axis=1), weight


def boundary_corners(
    triangles: Ints, patch: Ints, n_samples: int, n_vertices: int
) -> tuple[Ints, Ints, Ints]:
    """Which colour `(t, 3)` each corner of triangles has, and the boundary vertices and patches of colours.

    Interior vertices, of numbers from `n_samples` up to `n_vertices`, have one colour each. Then come those
    of every pair of boundary vertex and patch in use: by vertex, counted without the interior ones, then by
    patch.
    """
    found: tuple[Ints, Ints, Ints] = _boundary_corners(triangles, patch, n_samples, n_vertices)
    return found


@kernel
def _boundary_corners(triangles, patch, n_samples, n_vertices):
    n_interior = n_vertices - n_samples
    n_boundary = max(n_vertices, triangles.max() + 1) - n_interior if len(triangles) else n_samples
    start = np.zeros(n_boundary + 1, np.int64)
    for t in range(len(triangles)):
        for k in range(3):
            vertex = _boundary_number(triangles[t, k], n_samples, n_vertices)
            start[vertex + 1] += vertex >= 0
    for v in range(n_boundary):
        start[v + 1] += start[v]
    # Patches of each boundary vertex, in order.
    listed, last = np.empty(start[n_boundary], np.int64), start[:-1].copy()
    for t in range(len(triangles)):
        for k in range(3):
            vertex = _boundary_number(triangles[t, k], n_samples, n_vertices)
            if vertex < 0:
                continue
            i = start[vertex]
            while i < last[vertex] and listed[i] < patch[t]:
                i += 1
            if i < last[vertex] and listed[i] == patch[t]:
                continue
            for j in range(last[vertex], i, -1):
                listed[j] = listed[j - 1]
            listed[i] = patch[t]
            last[vertex] += 1
    number = np.zeros(n_boundary + 1, np.int64)
    for v in range(n_boundary):
        number[v + 1] = number[v] + last[v] - start[v]
    vertex_of, patch_of = np.empty(number[n_boundary], np.int64), np.empty(number[n_boundary], np.int64)
    for v in range(n_boundary):
        for i in range(number[v + 1] - number[v]):
            vertex_of[number[v] + i], patch_of[number[v] + i] = v, listed[start[v] + i]
    color = np.empty(triangles.shape, np.int64)
    for t in range(len(triangles)):
        for k in range(3):
            vertex = _boundary_number(triangles[t, k], n_samples, n_vertices)
            if vertex < 0:
                color[t, k] = triangles[t, k] - n_samples
                continue
            i = start[vertex]
            while listed[i] != patch[t]:
                i += 1
            color[t, k] = n_interior + number[vertex] + i - start[vertex]
    return color, vertex_of, patch_of


@bare_kernel
def _boundary_number(vertex, n_samples, n_vertices):
    """The number of a boundary vertex without the interior ones, -1 for those."""
    if vertex < n_samples:
        return vertex
    return vertex - n_vertices + n_samples if vertex >= n_vertices else -1


@bare_kernel
def _mix_free(boundary, points, patch, left, of_control, size, columns, values):
    """Compressed rows of the free vertices: `boundary` and `points` are those of their blend, `patch` is
    theirs, and `left` the patch to the left of each control point."""
    start, control, weight = boundary
    point_start, point, point_weight = points
    n = 0
    for row in range(len(patch)):
        for e in range(start[row], start[row + 1]):
            side = LEFT if left[control[e]] == patch[row] else RIGHT
            columns[n], values[n] = of_control[side, control[e]], weight[e]
            n += 1
        for e in range(point_start[row], point_start[row + 1]):
            columns[n], values[n] = size + point[e], point_weight[e]
            n += 1


def color_space(network: Network, hard: NDArray[np.bool_]) -> ColorSpace:
    """Number the boundary colours of a network whose curves are `hard` `(c,)` or soft."""
    n_patches, sides, closed = len(network.loops), network.sides, network.family.closed
    inside = sides != OUTSIDE
    nodes = np.array([(curve.start, curve.end) for curve in network.curves])
    key = nodes[:, :, None] * n_patches + sides[:, None, :]  # of every curve, end and side
    at_node = ~closed[:, None, None] & np.repeat(inside[:, None, :], 2, axis=1)
    node_keys = np.unique(key[at_node])
    tied = ~closed & ~hard & inside.all(axis=1)
    tie = np.searchsorted(node_keys, key[tied].reshape(-1, 2))
    of_node = united(*np.ascontiguousarray(tie.T), len(node_keys))
    size = int(of_node.max(initial=-1)) + 1

    # Curve by curve the inner control points of the right side, then those of the left one that are its own.
    own = np.stack([inside[:, 0], inside[:, 1] & (hard | ~inside[:, 0])], axis=1)
    count = own * (np.diff(network.offsets) - 2 * ~closed)[:, None]
    first = (size + np.cumsum(count) - count.ravel()).reshape(-1, 2)
    first[:, 1] = np.where(own[:, 1], first[:, 1], first[:, 0])
    curve = np.repeat(np.arange(len(closed)), np.diff(network.offsets))
    within = np.arange(len(curve)) - (network.offsets[:-1] + ~closed)[curve]
    of_control = np.where(inside[curve], first[curve] + within[:, None], OUTSIDE)
    c, end, side = np.nonzero(at_node)
    place = np.where(end == 0, network.offsets[c], network.offsets[c + 1] - 1)
    of_control[place, side] = of_node[np.searchsorted(node_keys, key[at_node])]
    return ColorSpace(size + int(count.sum()), of_control.T.copy(), node_keys, of_node, n_patches)
