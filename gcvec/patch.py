"""The generalized Coons patch, equations (1) and (2), as linear operators on control points.

With v_i = p_i on every polygon, equation (1) reads

    S(x) = Σ_i λ_i p_i + Σ_i (λ_i + λ_{i+1}) [C_i(t) - (1 - t) p_i - t p_{i+1}],   t = λ_{i+1} / (λ_i +
    λ_{i+1}):

the polygon's own interpolation plus the bulge of every curve over its chord. It holds for geometry and
colour alike, and for polygons with holes, where the sum runs over all loops. Both parts are linear in the
control points of the curves.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csgraph

from gcvec import bspline, raster
from gcvec.boundary import Network
from gcvec.harmonic import cotangent_laplacian, harmonic_extension
from gcvec.mesh import Mesh, build_mesh
from gcvec.samples import BoundarySamples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

NEGLIGIBLE = 1e-9
"""A curve whose two coordinates are not both above this does not bulge into a vertex."""


@dataclass(frozen=True)
class Blend:
    """How the free vertices of a mesh are blended from what surrounds them, equation (2).

    boundary  (f, c) sparse: weights of the control points of all curves
    points    (f, m) sparse: harmonic coordinates of the interior control points
    """

    boundary: sparse.csr_array
    points: sparse.csr_array


Entries = tuple[Ints, Ints, Floats]
"""Rows, columns and values of a sparse matrix."""


def coons(
    coordinates: Floats, columns: Ints, edges: Ints, network: Network, samples: BoundarySamples
) -> Entries:
    """Equation (1) as `(vertex, control point, weight)` entries.

    `coordinates` is `(f, n)`; column k belongs to the polygon vertex that is sample `columns[k]`
    (increasing); `edges` are
    the polygon edges of the patch.
    """
    if not len(columns):
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    ends = np.minimum(np.searchsorted(columns, samples.edge_ends[edges]), len(columns) - 1)
    known = columns[ends] == samples.edge_ends[edges]
    # A node lies on several curves: its colour is that of the curves of this patch.
    corner_control, corner_weight = np.zeros((len(columns), 4), np.int64), np.zeros((len(columns), 4))
    corner_control[ends[known]] = samples.edge_control[edges][known]
    corner_weight[ends[known]] = samples.edge_weight[edges][known]
    vertex, column = np.nonzero(coordinates)
    rows = [np.repeat(vertex, 4)]
    controls = [corner_control[column].ravel()]
    weights = [(coordinates[vertex, column][:, None] * corner_weight[column]).ravel()]
    both = known.all(axis=1)
    for edge, (a, b) in zip(edges[both], ends[both], strict=True):
        at = np.flatnonzero((coordinates[:, a] > NEGLIGIBLE) & (coordinates[:, b] > NEGLIGIBLE))
        if not len(at):
            continue
        la, lb = coordinates[at, a], coordinates[at, b]
        c = samples.edge_curve[edge]
        curve = network.curves[c]
        u0, u1 = samples.edge_u[edge]
        u = u0 + (u1 - u0) * lb / (la + lb)
        index, weight = bspline.basis(u, curve.segments, curve.closed)
        bulge = (
            (samples.offsets[c] + index, (la + lb)[:, None] * weight),
            (samples.edge_control[edge, 0], -la[:, None] * samples.edge_weight[edge, 0]),
            (samples.edge_control[edge, 1], -lb[:, None] * samples.edge_weight[edge, 1]),
        )
        for control, share in bulge:
            rows.append(np.repeat(at, 4))
            controls.append(np.broadcast_to(control, share.shape).ravel())
            weights.append(share.ravel())
    return np.concatenate(rows), np.concatenate(controls), np.concatenate(weights)


def blend(network: Network, samples: BoundarySamples, mesh: Mesh) -> Blend:
    """Blend of the free vertices, solved for every cluster of connected free vertices on its own."""
    n_free = len(mesh.vertices) - mesh.first_free
    boundary_entries: list[Entries] = []
    point_entries: list[Entries] = []
    if n_free:
        touches_free = (mesh.triangles >= mesh.first_free).any(axis=1)
        triangles, patch = mesh.triangles[touches_free], mesh.patch[touches_free]
        laplacian = cotangent_laplacian(mesh.vertices, triangles)
        _, cluster = csgraph.connected_components(laplacian[mesh.first_free :, mesh.first_free :])
        patch_of = np.zeros(n_free, np.int64)
        for k in range(3):
            free_corner = triangles[:, k] >= mesh.first_free
            patch_of[triangles[free_corner, k] - mesh.first_free] = patch[free_corner]
        edges_of = _edges_by_patch(network, samples)
        for members in _groups(cluster):
            edges = edges_of[patch_of[members[0]]]
            _blend_cluster(network, samples, mesh, laplacian, members, edges, boundary_entries, point_entries)
    return Blend(
        _sparse(boundary_entries, (n_free, int(samples.offsets[-1]))),
        _sparse(point_entries, (n_free, mesh.n_points)),
    )


def _blend_cluster(
    network: Network,
    samples: BoundarySamples,
    mesh: Mesh,
    laplacian: sparse.csr_array,
    members: Ints,
    edges: Ints,
    boundary_entries: list[Entries],
    point_entries: list[Entries],
) -> None:
    free = mesh.first_free + members
    around = np.unique(laplacian[free].indices)
    boundary = around[around < mesh.n_samples]
    points = around[(around >= mesh.n_samples) & (around < mesh.first_free)]
    ends, along = samples.ends[boundary], samples.along[boundary]
    columns = np.unique(ends)
    n = len(columns)
    values = np.zeros((len(boundary) + len(points), n + len(points)))
    rows = np.arange(len(boundary))
    at = np.searchsorted(columns, ends)
    values[rows, at[:, 0]] += 1 - along
    values[rows, at[:, 1]] += along
    values[len(boundary) + np.arange(len(points)), n + np.arange(len(points))] = 1.0
    coordinates = harmonic_extension(laplacian, free, np.concatenate([boundary, points]), values)

    row, control, weight = coons(coordinates[:, :n], columns, edges, network, samples)
    boundary_entries.append((members[row], control, weight))
    vertex, column = np.nonzero(coordinates[:, n:])
    own = (points[column] - mesh.n_samples).astype(np.int64)
    point_entries.append((members[vertex], own, coordinates[vertex, n + column]))


def _edges_by_patch(network: Network, samples: BoundarySamples) -> list[Ints]:
    sides = np.array([(c.left, c.right) for c in network.curves])[samples.edge_curve]
    edge = np.concatenate([np.arange(len(sides))] * 2)
    patch = sides.T.ravel()
    order = np.argsort(patch, kind="stable")
    cuts = np.searchsorted(patch[order], np.arange(len(network.loops) + 1))
    return [edge[order[a:b]] for a, b in zip(cuts[:-1], cuts[1:], strict=True)]


def _groups(labels: NDArray[np.int32]) -> list[Ints]:
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.cumsum(np.bincount(labels))[:-1])


def _sparse(entries: list[Entries], shape: tuple[int, int]) -> sparse.csr_array:
    if not entries:
        return sparse.csr_array(shape)
    rows, columns, values = (np.concatenate(part) for part in zip(*entries, strict=True))
    return sparse.coo_array((values, (rows, columns)), shape=shape).tocsr()


@dataclass(frozen=True)
class Geometry:
    """The map S from the parameter domains to the image, linear on the mesh without control points.

    mesh          that mesh
    blend         its free vertices as blends of the curves
    image         (v, 2) where S takes its vertices
    triangle_at   (h, w) int32, the triangle that holds each pixel centre in the parameter domain
    """

    mesh: Mesh
    blend: Blend
    image: Floats
    triangle_at: NDArray[np.int32]

    def to_image(self, points: Floats) -> Floats:
        """S at points `(n, 2)` of the parameter domain, each in the triangle that holds its pixel's
        centre."""
        shift = self.image - self.mesh.vertices
        return points + self.interpolate(points, shift[self.mesh.triangles])

    def interpolate(self, points: Floats, corner_values: Floats) -> Floats:
        """A function given at the corners of the mesh's triangles `(t, 3, d)`, at points `(n, 2)` of the
        domain."""
        height, width = self.triangle_at.shape
        column = np.clip(points[:, 0].astype(np.int64), 0, width - 1)
        row = np.clip(points[:, 1].astype(np.int64), 0, height - 1)
        triangle = self.triangle_at[row, column]
        a, b, c = (self.mesh.vertices[self.mesh.triangles[triangle, k]] for k in range(3))
        (ux, uy), (vx, vy), (px, py) = (b - a).T, (c - a).T, (points - a).T
        area = ux * vy - uy * vx
        s, t = (px * vy - py * vx) / area, (ux * py - uy * px) / area
        weights = np.stack([1 - s - t, s, t], axis=1)
        return np.asarray(np.einsum("nk,nkd->nd", weights, corner_values[triangle]))

    def moved(self, samples: BoundarySamples, control_points: Floats) -> Geometry:
        """S with other control points `(c, 2)`. Equation (1) is linear in them: nothing is solved again."""
        return replace(self, image=_image(samples, self.blend, control_points))

    def patch_at(self) -> Ints:
        """`(h, w) int64`: the patch whose parameter domain holds each pixel centre."""
        return np.asarray(self.mesh.patch[self.triangle_at])


def geometry(network: Network, samples: BoundarySamples, control_points: Floats) -> Geometry:
    """Evaluate equation (1) for positions on the mesh of the bare parameter domains.

    `control_points` `(c, 2)` are those of all curves.
    """
    mesh = build_mesh(network, samples, np.zeros((0, 2), np.int64))
    blended = blend(network, samples, mesh)
    triangle_at = raster.triangle_at_pixel_centres(
        mesh.vertices, mesh.triangles, network.width, network.height
    )
    return Geometry(mesh, blended, _image(samples, blended, control_points), triangle_at)


def _image(samples: BoundarySamples, blended: Blend, control_points: Floats) -> Floats:
    on_curves = samples.on_curves(control_points)
    return np.concatenate([on_curves, blended.boundary @ control_points])
