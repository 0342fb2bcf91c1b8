"""The generalized Coons patch, equations (1) and (2), as linear operators on control points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec import raster
from gcvec.curves.network import Network
from gcvec.disjoint_sets import united
from gcvec.parallel import in_turn
from gcvec.patches.coons import coons
from gcvec.patches.harmonic import cotangent_laplacian, faded_coordinates
from gcvec.patches.mesh import Mesh
from gcvec.patches.samples import BoundarySamples
from gcvec.raster.triangle import barycentric_at

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Blend:
    """How the free vertices of a mesh are blended from what surrounds them, equation (2).

    boundary  (f, c) sparse: weights of the control points of all curves
    points    (f, m) sparse: harmonic coordinates of the interior control points
    """

    boundary: sparse.csr_array
    points: sparse.csr_array


def solve_blend(network: Network, samples: BoundarySamples, mesh: Mesh) -> Blend:
    """Blend of the free vertices, solved for every cluster of connected free vertices on its own."""
    n_free = len(mesh.vertices) - mesh.first_free
    boundary, points = (sparse.csr_array((n_free, n)) for n in (int(samples.offsets[-1]), mesh.n_points))
    if not n_free:
        return Blend(boundary, points)
    touches_free = (mesh.triangles >= mesh.first_free).any(axis=1)
    triangles, patch = mesh.triangles[touches_free], mesh.patch[touches_free]
    laplacian = cotangent_laplacian(mesh.vertices, triangles)
    joined = laplacian[mesh.first_free :, mesh.first_free :].tocoo()
    cluster = united(joined.row.astype(np.int64), joined.col.astype(np.int64), n_free)
    patch_of = np.zeros(n_free, np.int64)
    for k in range(3):
        free_corner = triangles[:, k] >= mesh.first_free
        patch_of[triangles[free_corner, k] - mesh.first_free] = patch[free_corner]
    edges_of = _edges_by_patch(network, samples)
    clusters = sorted(_groups(cluster), key=len, reverse=True)
    blends = in_turn(
        lambda members: _blend_cluster(
            network, samples, mesh, laplacian, members, edges_of[patch_of[members[0]]]
        ),
        clusters,
    )
    back = np.argsort(np.concatenate(clusters))
    return Blend(
        sparse.vstack([part.boundary for part in blends], "csr")[back],
        sparse.vstack([part.points for part in blends], "csr")[back],
    )


def _blend_cluster(
    network: Network,
    samples: BoundarySamples,
    mesh: Mesh,
    laplacian: sparse.csr_array,
    members: Ints,
    edges: Ints,
) -> Blend:
    """Rows of the blend for the connected free vertices `members` of the patch with these polygon edges."""
    free = mesh.first_free + members
    around = np.unique(laplacian[free].indices)
    boundary = around[around < mesh.n_samples]
    points = around[(around >= mesh.n_samples) & (around < mesh.first_free)]
    ends, along = samples.ends[boundary], samples.along[boundary]
    columns = np.unique(ends)
    n = len(columns)
    row = np.arange(len(boundary))
    at = np.searchsorted(columns, ends)
    own = np.arange(len(points))
    rows = np.concatenate([row, row, len(boundary) + own])
    entries = np.concatenate([1 - along, along, np.ones(len(points))])
    shape = (len(boundary) + len(points), n + len(points))
    values = sparse.coo_array((entries, (rows, np.concatenate([at[:, 0], at[:, 1], n + own]))), shape=shape)
    coordinates = faded_coordinates(laplacian, free, np.concatenate([boundary, points]), values.tocsr())

    of_points = coordinates[:, n:]
    numbers = (points[of_points.indices] - mesh.n_samples).astype(np.int32)
    return Blend(
        coons(coordinates[:, :n], columns, edges, network.family, samples),
        sparse.csr_array((of_points.data, numbers, of_points.indptr), shape=(len(free), mesh.n_points)),
    )


def _edges_by_patch(network: Network, samples: BoundarySamples) -> list[Ints]:
    sides = network.sides[samples.edge_curve]
    edge = np.concatenate([np.arange(len(sides))] * 2)
    patch = sides.T.ravel()
    order = np.argsort(patch, kind="stable")
    cuts = np.searchsorted(patch[order], np.arange(len(network.loops) + 1))
    return [edge[order[a:b]] for a, b in zip(cuts[:-1], cuts[1:], strict=True)]


def _groups(labels: Ints) -> list[Ints]:
    order = np.argsort(labels, kind="stable")
    return np.split(order, np.cumsum(np.bincount(labels))[:-1])


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
        weights = barycentric_at(self.mesh.vertices, self.mesh.triangles[triangle], points)
        return np.asarray(np.einsum("nk,nkd->nd", weights, corner_values[triangle]))

    def moved(self, samples: BoundarySamples, control_points: Floats) -> Geometry:
        """S with other control points `(c, 2)`. Equation (1) is linear in them: nothing is solved again."""
        return replace(self, image=_image(samples, self.blend, control_points))

    def patch_at(self) -> Ints:
        """`(h, w) int64`: the patch whose parameter domain holds each pixel centre; in a part of a picture
        one more than there are where none does."""
        nowhere = self.mesh.patch.max() + 1
        return np.asarray(np.append(self.mesh.patch, nowhere)[self.triangle_at])


def lay_geometry(network: Network, samples: BoundarySamples, mesh: Mesh, control_points: Floats) -> Geometry:
    """Evaluate equation (1) for positions on `mesh`, that of the bare parameter domains.

    `control_points` `(c, 2)` are those of all curves.
    """
    blended = solve_blend(network, samples, mesh)
    triangle_at = raster.triangle_at_pixel_centres(
        mesh.vertices, mesh.triangles, network.width, network.height
    )
    return Geometry(mesh, blended, _image(samples, blended, control_points), triangle_at)


def _image(samples: BoundarySamples, blended: Blend, control_points: Floats) -> Floats:
    on_curves = samples.on_curves(control_points)
    return np.concatenate([on_curves, blended.boundary @ control_points])
