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
from gcvec.least_squares import bounded_least_squares
from gcvec.raster import Coverage
from gcvec.timing import StageClock

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FITTING_WEIGHT = 1.0
FINAL_WEIGHT = 0.2
"""w of equation (7), while points are still being placed and in the last fit."""

BOUNDARY_WEIGHT = 0.05
"""Pull of a boundary colour towards its first estimate (section 4.3)."""

CLEARANCE = 0.3
"""Control points keep this far from the edges of their parameter polygon, pixels."""

GROWTH = 0.3
FIRST_POINTS = 1 / 1500
"""A round adds this share of the points there are, and this many a pixel on top."""

LEAST_COVER = 0.3
"""A pixel can become a control point of a triangle that covers at least this share of it."""


@dataclass(frozen=True)
class Fit:
    """Colours of all unknowns `(n, 3)` in [0, 1] and the picture `(pixels, 3)` they give."""

    colors: Floats
    picture: Floats


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
    blocked = ~_room(foundation)
    points = np.zeros((0, 2), np.int64)
    seen = np.zeros((0, 3))
    iteration = 0
    while True:
        with clock.stage("mesh_harmonic"):
            canvas, points, seen = _unfolded_canvas(foundation, points, seen, blocked)
            foundation = canvas.foundation
        with clock.stage("evaluation"):
            drawing = canvas.drawing()
            coverage = canvas.coverage(drawing)
        with clock.stage("optimization"):
            fit = fit_colors(canvas, drawing, coverage, truth, boundary_colors, seen, FITTING_WEIGHT)
        with clock.stage("evaluation"):
            square = ((fit.picture - truth) ** 2).sum(axis=1)
            mse = square.mean() / 3 * 65025
            score, worst_pixel = _score(coverage.start, coverage.pixel, coverage.weights, square)
            by_region = np.bincount(drawing.patch, score)
        iteration += 1
        worst = float(np.abs(fit.picture - truth).max() * 255)
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
        seen = np.concatenate([seen, picture[new[:, 1], new[:, 0]]])
    with clock.stage("optimization"):
        fit = fit_colors(canvas, drawing, coverage, truth, boundary_colors, seen, FINAL_WEIGHT)
    return Refined(foundation, points, fit.colors)


def _unfolded_canvas(
    foundation: Foundation, points: Ints, seen: Floats, blocked: NDArray[np.bool_]
) -> tuple[Canvas, Ints, Floats]:
    """A canvas without fold-over.

    Control points in triangles that turn over are taken out for good; triangles that turn over without one ask for parameter
    polygons closer to their curves.
    """
    while True:
        canvas = lay_canvas(foundation, points)
        corners = canvas.mesh.triangles[canvas.foldovers()]
        if not len(corners):
            return canvas, points, seen
        bad = np.unique(corners[(corners >= canvas.mesh.n_samples) & (corners < canvas.mesh.first_free)])
        bad -= canvas.mesh.n_samples
        if len(bad):
            blocked[points[bad, 1], points[bad, 0]] = True
            points, seen = np.delete(points, bad, axis=0), np.delete(seen, bad, axis=0)
            continue
        finer = refined_domains(foundation, corners)
        if finer is None:
            return canvas, points, seen
        foundation = finer


def fit_colors(
    canvas: Canvas,
    drawing: Drawing,
    coverage: Coverage,
    truth: Floats,
    boundary_colors: Floats,
    seen: Floats,
    weight: float,
) -> Fit:
    """Equation (7), with the boundary colours among the unknowns: every colour in [0, 1].

    ŷ = B R x, where R takes the unknowns to the mesh and B the mesh to pixels.
    """
    operator, corner_color = canvas.operator(drawing)
    to_pixels = coverage.matrix(corner_color, operator.shape[0])
    prior = np.concatenate([boundary_colors, seen])
    pull = np.concatenate([np.full(len(boundary_colors), BOUNDARY_WEIGHT), np.full(len(seen), weight)])
    normal = operator.T @ (to_pixels.T @ to_pixels) @ operator + sparse.diags_array(pull)
    right = operator.T @ (to_pixels.T @ truth) + pull[:, None] * prior
    colors = bounded_least_squares(normal.tocsr(), right)
    return Fit(colors, to_pixels @ (operator @ colors))


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


def _room(foundation: Foundation) -> NDArray[np.bool_]:
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
