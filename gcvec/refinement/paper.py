"""Error-driven interior control points exactly as the paper inserts them (section 4.4), one at a time.

Region by region: evaluate the region's pixels, make the worst of them a control point, mesh anew, solve all
coordinates anew, fit all interior colours anew. Slow and simple: the measure of what the rounds of
`gcvec.refinement.batch` do. As in the paper a pixel counts by the colour at its centre, and the boundary
keeps the colours of section 4.3.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from gcvec import raster
from gcvec.error_scale import PEAK_SQUARE
from gcvec.patches.canonical import Canvas, Foundation, lay_canvas
from gcvec.patches.drawing import folded
from gcvec.patches.mesh import Mesh, build_mesh, patch_mesh
from gcvec.patches.patch import solve_blend
from gcvec.raster.triangle import barycentric_at
from gcvec.refinement.clearance import find_clear_pixels
from gcvec.refinement.draft import Draft, by_rows, drafted, image_of
from gcvec.refinement.rounding import Rounding
from gcvec.refinement.scene import Iteration, Scene, Terms
from gcvec.timing import StageClock

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

WEIGHT = 30.0
"""w of equation (7)."""


def refine_paper(
    scene: Scene, terms: Terms, on_iteration: Callable[[Iteration], None], clock: StageClock
) -> Draft:
    """A file with every region's own error below the target: that of colours before
    they are rounded. Every iteration adds one point."""
    points, colors = worst_pixels(scene, terms, on_iteration, clock)
    with clock.stage("encode"):
        order, n_boundary = by_rows(points), len(scene.boundary_colors)
        points = points[order]
        colors = np.concatenate([scene.boundary_colors, colors[n_boundary:][order]])
        canvas = lay_canvas(scene.foundation, points)
        density = len(colors) / (scene.pixels.size / 3)
        steps = Rounding(terms.target_mse, terms.axes).steps(density)
        return drafted(image_of(canvas, points, colors, scene, steps), scene)


def worst_pixels(
    scene: Scene, terms: Terms, on_iteration: Callable[[Iteration], None], clock: StageClock
) -> tuple[Ints, Floats]:
    """The loop itself: control points `(m, 2)` and all colours `(b + m, 3)`.

    Every region is looked at until nothing is left to add, for points near a border thin out the free
    vertices of the mesh beyond it.
    """
    foundation = scene.foundation
    state = _Refinement(scene, clock)
    limit = terms.max_points or len(state.truth)
    regions = range(len(foundation.network.loops))
    for region in regions:
        state.evaluate(region, build_mesh(foundation.network, foundation.samples, state.points))
    grown = True
    while grown:
        before = len(state.points)
        for region in regions:
            state.evaluate(region, build_mesh(foundation.network, foundation.samples, state.points))
            while state.mse(region) >= terms.target_mse and state.count(region) < limit:
                mesh = state.insert_worst(region)
                if mesh is None:
                    break
                state.refit(region, mesh)
                n = len(state.points)
                on_iteration(Iteration(n, n, region, state.worst(), state.mse(), frozenset({region})))
        grown = len(state.points) > before
    return state.points, np.concatenate([scene.boundary_colors, state.colors])


class _Refinement:
    """The interior control points so far, and what the picture looks like with them.

    points, of_region, colors, wanted  position, region, colour and y* of every control point
    owner, error  region and error (h * w, 3) of every pixel
    usable        (h, w) the pixels of the parameter domain that may still become control points
    """

    def __init__(self, scene: Scene, clock: StageClock) -> None:
        self.foundation, self.boundary_colors = scene.foundation, scene.boundary_colors
        self.clock = clock
        self.truth = scene.pixels.reshape(-1, 3) / 255.0
        self.domain_pixel = domain_pixels(scene.foundation)
        self.patch_at = scene.foundation.geometry.patch_at()
        self.usable = find_clear_pixels(scene.foundation)
        self.points = np.zeros((0, 2), np.int64)
        self.of_region = np.zeros(0, np.int64)
        self.colors, self.wanted = np.zeros((0, 3)), np.zeros((0, 3))
        self.owner = np.full(len(self.truth), -1)
        self.error = np.zeros_like(self.truth)

    def count(self, region: int) -> int:
        return int((self.of_region == region).sum())

    def mse(self, region: int | None = None) -> float:
        error = self.error if region is None else self.error[self.owner == region]
        return float((error**2).mean() * PEAK_SQUARE) if len(error) else 0.0

    def worst(self) -> float:
        return float(np.abs(self.error).max() * 255)

    def evaluate(self, region: int, mesh: Mesh) -> None:
        """Measure the pixels of a region."""
        self._measure(region, *self._pixels(region, mesh))

    def insert_worst(self, region: int) -> Mesh | None:
        """Make the worst pixel that can be one a control point; the mesh with it, None when no pixel can."""
        pixels = np.flatnonzero(self.owner == region)
        square = (self.error[pixels] ** 2).sum(axis=1)
        for pixel in pixels[np.argsort(-square, kind="stable")]:
            x, y = self.domain_pixel[pixel]
            if x < 0 or not self.usable[y, x] or self.patch_at[y, x] != region:
                continue
            self.usable[y, x] = False
            points = np.concatenate([self.points, [[x, y]]])
            with self.clock.stage("mesh_harmonic"):
                mesh = build_mesh(self.foundation.network, self.foundation.samples, points)
            if turns_over(self.foundation, mesh):
                continue
            self.points = points
            self.of_region = np.append(self.of_region, region)
            self.wanted = np.concatenate([self.wanted, self.truth[pixel][None]])
            self.colors = np.concatenate([self.colors, self.truth[pixel][None]])
            return mesh
        return None

    def refit(self, region: int, mesh: Mesh) -> None:
        """Fit all interior colours of a region, equation (7), and measure its pixels."""
        pixels, matrix = self._pixels(region, mesh)
        own = self.of_region == region
        with self.clock.stage("optimization"):
            self.colors[own] = fitted_colors(
                matrix, self.boundary_colors, self.truth[pixels], self.wanted[own]
            )
        self._measure(region, pixels, matrix)

    def _pixels(self, region: int, mesh: Mesh) -> tuple[Ints, sparse.csr_array]:
        with self.clock.stage("mesh_harmonic"):
            canvas = region_canvas(self.foundation, mesh, region)
        with self.clock.stage("evaluation"):
            return at_pixel_centres(canvas)

    def _measure(self, region: int, pixels: Ints, matrix: sparse.csr_array) -> None:
        with self.clock.stage("evaluation"):
            colors = np.concatenate([self.boundary_colors, self.colors[self.of_region == region]])
            self.owner[pixels] = region
            self.error[pixels] = matrix @ colors - self.truth[pixels]


def fitted_colors(matrix: sparse.csr_array, boundary_colors: Floats, truth: Floats, wanted: Floats) -> Floats:
    """Equation (7), solved exactly, then limited to [0, 1]: colours `(m, 3)` of a region's points.

    `matrix` comes from `at_pixel_centres`, `truth` `(p, 3)` the colours of its pixels, `wanted` `(m, 3)` y*.
    """
    n_boundary = len(boundary_colors)
    basis = matrix[:, n_boundary:]
    beyond_boundary = truth - matrix[:, :n_boundary] @ boundary_colors
    normal = (basis.T @ basis + WEIGHT * sparse.eye_array(basis.shape[1])).tocsc()
    right = basis.T @ beyond_boundary + WEIGHT * wanted
    return np.clip(splu(normal).solve(right), 0, 1)


def region_canvas(foundation: Foundation, mesh: Mesh, region: int) -> Canvas:
    """The part of the canonical mesh that belongs to one region, with that region's control points alone."""
    part, _ = patch_mesh(mesh, region)
    places = foundation.geometry.to_image(part.vertices[part.n_samples :])
    return Canvas(foundation, part, solve_blend(foundation.network, foundation.samples, part), places)


def at_pixel_centres(canvas: Canvas) -> tuple[Ints, sparse.csr_array]:
    """The pixels `(p,)`, row-major, whose centres a canvas covers, and their colours as a linear map.

    The map is `(p, b + m)`, from b boundary unknowns and m control points.
    """
    network = canvas.foundation.network
    drawing = canvas.drawing()
    operator, corner_color = canvas.operator(drawing)
    pixels, triangle, weights = _located(drawing.image, drawing.triangles, network.width, network.height)
    rows = np.repeat(np.arange(len(pixels)), 3)
    shape = (len(pixels), operator.shape[0])
    to_pixels = sparse.coo_array((weights.ravel(), (rows, corner_color[triangle].ravel())), shape=shape)
    return pixels, (to_pixels.tocsr() @ operator).tocsr()


def domain_pixels(foundation: Foundation) -> Ints:
    """For every pixel `(h * w, 2)` the pixel (x, y) of the parameter domain that S takes to its centre.

    -1 where there is none: centres between a curve and its chord.
    """
    geometry, network = foundation.geometry, foundation.network
    mesh = geometry.mesh
    pixels, triangle, weights = _located(geometry.image, mesh.triangles, network.width, network.height)
    result = np.full((network.width * network.height, 2), -1)
    domain = np.einsum("nk,nkd->nd", weights, mesh.vertices[mesh.triangles[triangle]])
    result[pixels] = np.clip(domain, 0, [network.width - 1, network.height - 1]).astype(np.int64)
    return result


def turns_over(foundation: Foundation, mesh: Mesh) -> bool:
    """Whether S folds a mesh."""
    geometry, n = foundation.geometry, mesh.n_samples
    image = np.concatenate([geometry.image[:n], geometry.to_image(mesh.vertices[n:])])
    return len(folded(image, mesh.triangles)) > 0


def _located(vertices: Floats, triangles: Ints, width: int, height: int) -> tuple[Ints, Ints, Floats]:
    """Pixels whose centres lie in a triangle, the triangle, and their barycentric coordinates `(p, 3)`."""
    owner = raster.triangle_at_pixel_centres(vertices, triangles, width, height).ravel()
    pixels = np.flatnonzero(owner >= 0)
    triangle = owner[pixels].astype(np.int64)
    centre = np.asarray(np.stack([pixels % width, pixels // width], axis=1) + 0.5, np.float64)
    return pixels, triangle, barycentric_at(vertices, triangles[triangle], centre)
