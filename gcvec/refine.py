"""Error-driven interior control points (paper, section 4.4), in batches.

Each round fits all colours by least squares, equation (7), measures the picture, and puts new control points at the worst pixels
of the worst triangles. One falling threshold serves all regions, so points go where they buy most.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import sparse

from gcvec.canonical import Canvas, Foundation, lay_canvas, refined_domains
from gcvec.drawing import Drawing
from gcvec.least_squares import NormalEquations, solve, solve_bounded
from gcvec.raster import Coverage
from gcvec.timing import StageClock

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FITTING_WEIGHT = 0.1
FINAL_WEIGHT = 0.1
"""w of equation (7), while points are still being placed and in the last fit."""

BOUNDARY_WEIGHT = 0.05
"""Pull of a boundary colour towards its first estimate (section 4.3)."""

ROUND_ITERATIONS = 12
FINAL_ITERATIONS = 60
"""Conjugate gradient steps in a round, which starts from the colours of the last, and in the last fit."""

CLEARANCE = 0.3
"""Control points keep this far from the edges of their parameter polygon, pixels."""

GROWTH = 0.2
FIRST_POINTS = 1 / 1500
"""A round adds this share of the points there are, and this many a pixel on top."""

LEAST_COVER = 0.3
"""A pixel can become a control point of a triangle that covers at least this share of it."""


@dataclass(frozen=True)
class Refined:
    """Control points `(n, 2)` as pixels of the parameter domain, and all unknown colours, boundary first.

    The foundation is the one given, or one with finer parameter polygons where points asked for it.
    """

    foundation: Foundation
    points: Ints
    colors: Floats


@dataclass(frozen=True)
class Step:
    """What a round found: for progress reports."""

    iteration: int
    points: int
    worst_region: int
    worst_error: float
    mse: float


def refine_batch(
    foundation: Foundation,
    boundary_colors: Floats,
    picture: Floats,
    target_mse: float,
    max_points: int,
    on_step: Callable[[Step], None],
    clock: StageClock,
) -> Refined:
    """Control points and colours that bring the picture `(h, w, 3)` in [0, 1] to `target_mse` (0-255 scale).

    `max_points` bounds the points of one region, 0 lifts the bound.
    """
    truth = picture.reshape(-1, 3)
    blocked = ~room(foundation)
    n_boundary = len(boundary_colors)
    boundary_pull = np.full(n_boundary, BOUNDARY_WEIGHT)
    points = np.zeros((0, 2), np.int64)
    colors = boundary_colors
    iteration = 0
    while True:
        with clock.stage("mesh_harmonic"):
            canvas, kept = _unfolded_canvas(foundation, points, blocked)
            foundation, points = canvas.foundation, points[kept]
            colors = np.concatenate([colors[:n_boundary], colors[n_boundary:][kept]])
        with clock.stage("evaluation"):
            drawing = canvas.drawing()
            coverage = canvas.coverage(drawing)
        with clock.stage("optimization"):
            fit = color_fit(canvas, drawing, coverage, truth)
            prior = np.concatenate([boundary_colors, picture[points[:, 1], points[:, 0]]])
            pull = np.concatenate([boundary_pull, np.full(len(points), FITTING_WEIGHT)])
            colors = np.clip(solve(fit.equations(prior, pull), colors, ROUND_ITERATIONS, 1e-4), 0, 1)
            predicted = fit.picture(colors)
        with clock.stage("evaluation"):
            square = ((predicted - truth) ** 2).sum(axis=1)
            mse = square.mean() / 3 * 65025
            score, worst_pixel = _score(coverage.start, coverage.pixel, coverage.weights, square)
            by_region = np.bincount(drawing.patch, score)
        iteration += 1
        worst = float(np.abs(predicted - truth).max() * 255)
        on_step(Step(iteration, len(points), int(by_region.argmax()), worst, float(mse)))
        if mse <= target_mse:
            break
        wanted = min(
            GROWTH * len(points) + FIRST_POINTS * len(truth) + 1, (mse / target_mse - 1) * len(points) + 64
        )
        new = _choose(foundation, canvas, drawing, score, worst_pixel, blocked, int(wanted), max_points)
        if not len(new):
            break
        points = np.concatenate([points, new])
        colors = np.concatenate([colors, picture[new[:, 1], new[:, 0]]])
    with clock.stage("optimization"):
        pull[n_boundary:] = FINAL_WEIGHT
        colors = solve_bounded(fit.equations(prior, pull), colors, FINAL_ITERATIONS, 1e-5)
    return Refined(foundation, points, colors)


def _unfolded_canvas(
    foundation: Foundation, points: Ints, blocked: NDArray[np.bool_]
) -> tuple[Canvas, NDArray[np.bool_]]:
    """A canvas without fold-over, and which of the points `(n,)` it kept.

    Control points in triangles that turn over are taken out for good; triangles that turn over without one ask for parameter
    polygons closer to their curves.
    """
    kept = np.ones(len(points), bool)
    while True:
        canvas = lay_canvas(foundation, points[kept])
        corners = canvas.mesh.triangles[canvas.foldovers()]
        if not len(corners):
            return canvas, kept
        bad = np.unique(corners[(corners >= canvas.mesh.n_samples) & (corners < canvas.mesh.first_free)])
        if len(bad):
            out = np.flatnonzero(kept)[bad - canvas.mesh.n_samples]
            blocked[points[out, 1], points[out, 0]] = True
            kept[out] = False
            continue
        finer = refined_domains(foundation, corners)
        if finer is None:
            return canvas, kept
        foundation = finer


@dataclass(frozen=True)
class ColorFit:
    """Equation (7) on one canvas: ŷ = B R x, where R takes the unknowns to the mesh and B the mesh to pixels."""

    operator: sparse.csr_array
    to_pixels: sparse.csr_array
    gram: sparse.csr_array
    target: Floats

    def equations(self, prior: Floats, pull: Floats) -> NormalEquations:
        """Normal equations with every unknown pulled towards `prior` `(n, 3)` with weight `pull` `(n,)`."""
        return NormalEquations(self.operator, self.gram, pull, self.target + pull[:, None] * prior)

    def picture(self, colors: Floats) -> Floats:
        """ŷ `(pixels, 3)`."""
        result: Floats = self.to_pixels @ (self.operator @ colors)
        return result


def color_fit(canvas: Canvas, drawing: Drawing, coverage: Coverage, truth: Floats) -> ColorFit:
    operator, corner_color = canvas.operator(drawing)
    to_pixels = coverage.matrix(corner_color, operator.shape[0])
    return ColorFit(
        operator, to_pixels, (to_pixels.T @ to_pixels).tocsr(), operator.T @ (to_pixels.T @ truth)
    )


@njit(cache=True, nogil=True)
def _score(start, pixel, weights, square):
    """Summed squared error of every triangle, and its worst pixel (-1 where it covers none well)."""
    n = len(start) - 1
    score = np.zeros(n)
    worst_pixel = np.full(n, -1, np.int64)
    for t in range(n):
        worst = -1.0
        for e in range(start[t], start[t + 1]):
            area = weights[e, 0] + weights[e, 1] + weights[e, 2]
            score[t] += area * square[pixel[e]]
            if area >= LEAST_COVER and square[pixel[e]] > worst:
                worst, worst_pixel[t] = square[pixel[e]], pixel[e]
    return score, worst_pixel


def _choose(
    foundation: Foundation,
    canvas: Canvas,
    drawing: Drawing,
    score: Floats,
    worst_pixel: Ints,
    blocked: NDArray[np.bool_],
    wanted: int,
    max_points: int,
) -> Ints:
    """At most `wanted` new control points, worst triangles first, no two within two pixels of each other."""
    order = np.argsort(-score)
    order = order[(worst_pixel[order] >= 0) & (score[order] > 0)]
    height, width = blocked.shape
    y, x = np.divmod(worst_pixel[order], width)
    centre = np.stack([x, y], axis=1) + 0.5
    in_domain = (2 * centre - foundation.geometry.to_image(centre)).astype(np.int64)
    in_domain = np.clip(in_domain, 0, [width - 1, height - 1])
    patch_at = foundation.geometry.patch_at()
    patch = drawing.patch[order]
    fits = patch_at[in_domain[:, 1], in_domain[:, 0]] == patch
    taken = canvas.mesh.vertices[canvas.mesh.n_samples : canvas.mesh.first_free].astype(np.int64)
    count = np.bincount(patch_at[taken[:, 1], taken[:, 0]], minlength=len(foundation.network.loops))
    limit = max_points or len(worst_pixel) + len(taken)
    return np.asarray(_pick(in_domain[fits], patch[fits], blocked, taken, count, limit, wanted))


@njit(cache=True, nogil=True)
def _pick(candidates, patch, blocked, taken, count, limit, wanted):
    height, width = blocked.shape
    occupied = blocked.copy()
    for i in range(len(taken)):
        occupied[taken[i, 1], taken[i, 0]] = True
    near = np.zeros((height, width), np.bool_)
    chosen = np.empty((min(wanted, len(candidates)), 2), np.int64)
    n = 0
    for i in range(len(candidates)):
        if n == len(chosen):
            break
        x, y = candidates[i, 0], candidates[i, 1]
        if occupied[y, x] or near[y, x] or count[patch[i]] >= limit:
            continue
        near[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = True
        count[patch[i]] += 1
        chosen[n, 0], chosen[n, 1] = x, y
        n += 1
    return chosen[:n]


def room(foundation: Foundation) -> NDArray[np.bool_]:
    """Pixels `(h, w)` whose centres keep clear of every polygon edge."""
    network, samples = foundation.network, foundation.samples
    ends = samples.domain[samples.edge_ends]
    return np.asarray(_clear_of(ends, network.width, network.height, CLEARANCE))


@njit(cache=True, nogil=True)
def _clear_of(edges, width, height, clearance):
    clear = np.ones((height, width), np.bool_)
    for e in range(len(edges)):
        ax, ay, bx, by = edges[e, 0, 0], edges[e, 0, 1], edges[e, 1, 0], edges[e, 1, 1]
        dx, dy = bx - ax, by - ay
        square = max(dx * dx + dy * dy, 1e-12)
        steps = int(max(abs(dx), abs(dy))) + 1
        for i in range(steps + 1):
            mx, my = int(ax + dx * i / steps), int(ay + dy * i / steps)
            for y in range(max(my - 2, 0), min(my + 3, height)):
                for x in range(max(mx - 2, 0), min(mx + 3, width)):
                    px, py = x + 0.5 - ax, y + 0.5 - ay
                    t = min(max((px * dx + py * dy) / square, 0.0), 1.0)
                    if np.hypot(px - t * dx, py - t * dy) < clearance:
                        clear[y, x] = False
    return clear
