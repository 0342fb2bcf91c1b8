"""From what a file stores to the mesh that a picture is defined on.

The recipe is deterministic: boundary samples from the curves, jittered control points, graded free points,
their constrained Delaunay triangulation, and equations (1) and (2) on it. Fit, error, rendering and export
all start here.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.curves.domain import FINEST_LEVEL, raise_levels, without_crossings
from gcvec.curves.network import Network
from gcvec.patches.color_space import ColorSpace, boundary_corners, color_space
from gcvec.patches.drawing import FLATNESS, Drawing, Polylines, draw, folded, polylines
from gcvec.patches.mesh import Mesh, build_mesh
from gcvec.patches.patch import Blend, Geometry, lay_geometry, solve_blend
from gcvec.patches.samples import BoundarySamples, boundary_samples
from gcvec.raster.coverage import Coverage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Foundation:
    """Everything that stays the same while control points are added: curves, samples, S and the boundary
    unknowns.

    `control_points` `(c, 2)` are those of all curves; they differ from the network's own after an edit, which
    moves the picture but leaves the parameter domains alone.
    """

    network: Network
    hard: NDArray[np.bool_]
    samples: BoundarySamples
    geometry: Geometry
    space: ColorSpace
    control_points: Floats

    @property
    def bare_canvas(self) -> Canvas:
        """The canvas without control points: its mesh is the one that S is defined on."""
        geometry = self.geometry
        return Canvas(self, geometry.mesh, geometry.blend, geometry.image[geometry.mesh.n_samples :])

    @cached_property
    def bare_colors(self) -> tuple[sparse.csr_array, Ints]:
        """R from the boundary unknowns to the colours of the mesh that S is defined on, with curves drawn
        along its edges, and which of them each corner of its triangles has."""
        bare = self.bare_canvas
        return bare.operator(bare.drawing(flatness=np.inf))

    def polylines(self, flatness: float) -> Polylines:
        """Its curves as polylines within `flatness` pixels of them."""
        if flatness == FLATNESS:
            return self._unit_polylines
        return polylines(self.network, self.samples, self.control_points, flatness)

    @cached_property
    def _unit_polylines(self) -> Polylines:
        return polylines(self.network, self.samples, self.control_points, FLATNESS)


@dataclass(frozen=True)
class Canvas:
    """The canonical mesh of a foundation with some control points, and how the unknown colours reach it.

    `places` `(v - n_samples, 2)` are the interior vertices in the image.
    """

    foundation: Foundation
    mesh: Mesh
    blend: Blend
    places: Floats

    @property
    def image(self) -> Floats:
        """`(v, 2)` all vertices of the mesh in the image."""
        return np.concatenate([self.foundation.geometry.image[: self.mesh.n_samples], self.places])

    def drawing(self, flatness: float = FLATNESS) -> Drawing:
        """The canvas with its curves drawn within `flatness` pixels of them; infinity: along its own
        edges.

        Where such a polyline would turn a triangle over, the curve is drawn as at scale 1, if that is
        coarser.
        """
        at_unit_scale = [self.foundation.polylines(FLATNESS)] if flatness < FLATNESS else []
        return draw([self.foundation.polylines(flatness), *at_unit_scale], self.mesh, self.image)

    def operator(self, drawing: Drawing) -> tuple[sparse.csr_array, Ints]:
        """R from unknowns to colours, and which colour each corner of the drawing's triangles has."""
        f = self.foundation
        return f.space.operator(f.network, f.samples, drawing, self.mesh, self.blend)

    @cached_property
    def unit(self) -> tuple[Drawing, sparse.csr_array, Ints]:
        """The drawing for output at the picture's own size, with its operator and corner colours."""
        drawing = self.drawing()
        return drawing, *self.operator(drawing)

    @cached_property
    def corner_colors(self) -> Ints:
        """Which of the colours of `unit` the corners `(t, 3)` of the mesh's own triangles have.

        A drawing numbers those of the boundary samples first, by sample and patch.
        """
        mesh = self.mesh
        return boundary_corners(mesh.triangles, mesh.patch, mesh.n_samples, len(mesh.vertices))[0]

    def coverage(self, drawing: Drawing, precision: type = np.float64) -> Coverage:
        network = self.foundation.network
        return Coverage(drawing.image, drawing.triangles, network.width, network.height, precision)

    def patch_of_points(self) -> Ints:
        """`(n,)` patch of every interior control point."""
        return self.mesh.patch_of_vertices[self.mesh.n_samples : self.mesh.first_free]

    def foldovers(self) -> Ints:
        """Triangles of the mesh that S turns over."""
        return folded(self.image, self.mesh.triangles)


def lay_foundation(
    network: Network, hard: NDArray[np.bool_], control_points: Floats | None = None
) -> Foundation:
    """The foundation of a network whose levels are final."""
    moved = network.control_points if control_points is None else control_points
    return _foundation(network, hard, moved, *_bare(network))


def _bare(network: Network) -> tuple[BoundarySamples, Mesh]:
    """The samples of a network, and the mesh of its parameter domains without control points."""
    samples = boundary_samples(network)
    return samples, build_mesh(network, samples, np.zeros((0, 2), np.int64))


def _foundation(
    network: Network, hard: NDArray[np.bool_], control_points: Floats, samples: BoundarySamples, mesh: Mesh
) -> Foundation:
    s = lay_geometry(network, samples, mesh, control_points)
    return Foundation(network, hard, samples, s, color_space(network, hard), control_points)


def lay_unfolded_foundation(network: Network, hard: NDArray[np.bool_]) -> Foundation:
    """The foundation after parameter polygons have been drawn closer to the curves wherever S folded over.

    In the limit the polygons are the sampled curves and S is the identity, so this ends.
    """
    network, samples, mesh = _unfolded_between_samples(network)
    foundation = _foundation(network, hard, network.control_points, samples, mesh)
    while True:
        mesh = foundation.geometry.mesh
        finer = refined_domains(foundation, mesh.triangles[folded(foundation.geometry.image, mesh.triangles)])
        if finer is None:
            return foundation
        foundation = finer


def _unfolded_between_samples(network: Network) -> tuple[Network, BoundarySamples, Mesh]:
    """The network with polygons so close that no triangle between samples alone folds over: most that do
    are of this kind, and S need not be solved to find them. With its samples and bare mesh."""
    while True:
        samples, mesh = _bare(network)
        between = mesh.triangles[(mesh.triangles < len(samples)).all(axis=1)]
        over = between[folded(samples.on_curves(network.control_points), between)]
        finer = _closer_polygons(network, samples, over)
        if finer is None:
            return network, samples, mesh
        network = finer


def refined_domains(foundation: Foundation, corners: Ints) -> Foundation | None:
    """The foundation with parameter polygons four times as close to the curves that pass through these mesh
    vertices.

    None where there are no such curves, or all of them are followed as closely as can be.
    """
    finer = _closer_polygons(foundation.network, foundation.samples, corners)
    if finer is None:
        return None
    samples, mesh = _bare(finer)
    s = lay_geometry(finer, samples, mesh, finer.control_points)
    # Levels are no matter of colours: their numbering stays.
    return replace(foundation, network=finer, samples=samples, geometry=s)


def _closer_polygons(network: Network, samples: BoundarySamples, corners: Ints) -> Network | None:
    """See `refined_domains`."""
    if not len(corners):
        return None
    on_boundary = np.unique(corners[corners < len(samples)])
    curves = set(samples.curve[on_boundary].tolist())
    nodes = set(on_boundary[on_boundary < samples.n_nodes].tolist())
    touched = [
        c
        for c, curve in enumerate(network.curves)
        if (c in curves or curve.start in nodes or curve.end in nodes)
        and not curve.on_frame
        and curve.level < FINEST_LEVEL
    ]
    return without_crossings(raise_levels(network, touched), touched) if touched else None


def lay_canvas(foundation: Foundation, points: Ints) -> Canvas:
    """Mesh and blend with control points at pixels `points` `(n, 2)` of the parameter domain."""
    if not len(points):
        return foundation.bare_canvas
    mesh = build_mesh(foundation.network, foundation.samples, points)
    places = foundation.geometry.to_image(mesh.vertices[mesh.n_samples :])
    return Canvas(foundation, mesh, solve_blend(foundation.network, foundation.samples, mesh), places)


def lay_unfolded_canvas(foundation: Foundation, points: Ints) -> tuple[Canvas, NDArray[np.bool_]]:
    """A canvas without fold-over, and which of the points `(n,)` it kept.

    Control points in triangles that turn over are left out; triangles that turn over without one ask for
    parameter polygons closer to their curves, so the canvas may have another foundation.
    """
    kept = np.ones(len(points), bool)
    while True:
        canvas = lay_canvas(foundation, points[kept])
        mesh = canvas.mesh
        corners = mesh.triangles[canvas.foldovers()]
        bad = np.unique(corners[(corners >= mesh.n_samples) & (corners < mesh.first_free)]) - mesh.n_samples
        if len(bad):
            kept[np.flatnonzero(kept)[bad]] = False
            continue
        finer = refined_domains(foundation, corners)
        if finer is None:
            return canvas, kept
        foundation = finer
