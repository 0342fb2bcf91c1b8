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
from gcvec.patches.drawing import FLATNESS, Drawing, draw, folded
from gcvec.patches.mesh import Mesh, build_mesh
from gcvec.patches.patch import Blend, Geometry, blend, geometry
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

    @cached_property
    def bare_canvas(self) -> Canvas:
        """The canvas without control points: its mesh is the one that S is defined on."""
        geometry = self.geometry
        return Canvas(self, geometry.mesh, geometry.blend, geometry.image[geometry.mesh.n_samples :])


@dataclass(frozen=True)
class Canvas:
    """The canonical mesh of a foundation with some control points, and how the unknown colours reach it.

    `places` `(v - n_samples, 2)` are the interior vertices in the image.
    """

    foundation: Foundation
    mesh: Mesh
    blend: Blend
    places: Floats

    def drawing(self, flatness: float = FLATNESS) -> Drawing:
        f = self.foundation
        return draw(f.network, f.samples, f.control_points, self.mesh, self.places, flatness)

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
        return self.mesh.patch_of_vertices()[self.mesh.n_samples : self.mesh.first_free]

    def foldovers(self) -> Ints:
        """Triangles of the mesh that S turns over."""
        f = self.foundation
        image = np.concatenate([f.samples.on_curves(f.control_points), self.places])
        return folded(image, self.mesh.triangles)


def lay_foundation(
    network: Network, hard: NDArray[np.bool_], control_points: Floats | None = None
) -> Foundation:
    """The foundation of a network whose levels are final."""
    samples = boundary_samples(network)
    moved = network.control_points if control_points is None else control_points
    return Foundation(
        network, hard, samples, geometry(network, samples, moved), color_space(network, hard), moved
    )


def lay_unfolded_foundation(network: Network, hard: NDArray[np.bool_]) -> Foundation:
    """The foundation after parameter polygons have been drawn closer to the curves wherever S folded over.

    In the limit the polygons are the sampled curves and S is the identity, so this ends.
    """
    foundation = lay_foundation(network, hard)
    while True:
        mesh = foundation.geometry.mesh
        finer = refined_domains(foundation, mesh.triangles[folded(foundation.geometry.image, mesh.triangles)])
        if finer is None:
            return foundation
        foundation = finer


def refined_domains(foundation: Foundation, corners: Ints) -> Foundation | None:
    """The foundation with parameter polygons four times as close to the curves that pass through these mesh
    vertices.

    None where there are no such curves, or all of them are followed as closely as can be.
    """
    if not len(corners):
        return None
    network, samples = foundation.network, foundation.samples
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
    if not touched:
        return None
    finer = without_crossings(raise_levels(network, touched), touched)
    samples, control_points = boundary_samples(finer), finer.control_points
    # Levels are no matter of colours: their numbering stays.
    return replace(
        foundation, network=finer, samples=samples, geometry=geometry(finer, samples, control_points)
    )


def lay_canvas(foundation: Foundation, points: Ints) -> Canvas:
    """Mesh and blend with control points at pixels `points` `(n, 2)` of the parameter domain."""
    mesh = build_mesh(foundation.network, foundation.samples, points)
    places = foundation.geometry.to_image(mesh.vertices[mesh.n_samples :])
    return Canvas(foundation, mesh, blend(foundation.network, foundation.samples, mesh), places)


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
