"""Where the next interior control points go, and which ones are worth least."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from gcvec.canonical import Canvas, Foundation
from gcvec.parallel import in_shares
from gcvec.raster import Coverage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CLEARANCE = 0.15
"""Control points keep this far from the edges of their parameter polygon, pixels."""

LEAST_COVER = 0.3
"""A pixel can become a control point of a triangle that covers at least this share of it."""

CANDIDATES = 8
"""Pixels of a triangle, the worst ones, that are tried as control points."""


def best_insertions(coverage: Coverage, residual: Floats) -> tuple[Floats, Ints]:
    """How much squared error a control point would save in each triangle, `(t,)`, and at which pixel (-1:
    none).

    Inside a triangle a new point at barycentric coordinates q reaches out like the hat function min_k(b_k /
    q_k). The best
    colour for it removes (Σ a r φ)² / Σ a φ² from the error, summed over the triangle's share `a` of each
    pixel.
    """
    start, pixel, weights = coverage.start, coverage.pixel, coverage.weights
    shares = in_shares(
        lambda first, last: _best_insertions(start[first : last + 1], pixel, weights, residual),
        len(start) - 1,
    )
    return np.concatenate([gain for gain, _ in shares]), np.concatenate([where for _, where in shares])


@njit(cache=True, nogil=True)
def _best_insertions(start, pixel, weights, residual):
    n = len(start) - 1
    gain = np.zeros(n)
    where = np.full(n, -1, np.int64)
    worst = np.empty(CANDIDATES)
    entry = np.empty(CANDIDATES, np.int64)
    for t in range(n):
        count = 0
        for e in range(start[t], start[t + 1]):
            area = weights[e, 0] + weights[e, 1] + weights[e, 2]
            if area < LEAST_COVER:
                continue
            p = pixel[e]
            square = residual[p, 0] ** 2 + residual[p, 1] ** 2 + residual[p, 2] ** 2
            if count < CANDIDATES or square > worst[count - 1]:
                k = min(count, CANDIDATES - 1)
                count = min(count + 1, CANDIDATES)
                while k > 0 and worst[k - 1] < square:
                    worst[k], entry[k] = worst[k - 1], entry[k - 1]
                    k -= 1
                worst[k], entry[k] = square, e
        for k in range(count):
            e = entry[k]
            area = weights[e, 0] + weights[e, 1] + weights[e, 2]
            q0, q1, q2 = weights[e, 0] / area, weights[e, 1] / area, weights[e, 2] / area
            if min(q0, q1, q2) < 0.02:
                continue
            r0, r1, r2, energy = 0.0, 0.0, 0.0, 1e-12
            for f in range(start[t], start[t + 1]):
                # The area is in the weights: this is a φ.
                share = min(weights[f, 0] / q0, weights[f, 1] / q1, weights[f, 2] / q2)
                if share <= 0.0:
                    continue
                p = pixel[f]
                r0 += share * residual[p, 0]
                r1 += share * residual[p, 1]
                r2 += share * residual[p, 2]
                energy += share * share / (weights[f, 0] + weights[f, 1] + weights[f, 2])
            saved = (r0 * r0 + r1 * r1 + r2 * r2) / energy
            if saved > gain[t]:
                gain[t], where[t] = saved, pixel[e]
    return gain, where


def choose_points(
    canvas: Canvas,
    patch: Ints,
    gain: Floats,
    where: Ints,
    blocked: NDArray[np.bool_],
    wanted: int,
    max_points: int,
    finished: NDArray[np.bool_],
    kept: NDArray[np.bool_],
) -> Ints:
    """At most `wanted` new control points, most useful first, no two within two pixels of each other.

    `patch`, `gain` and `where` belong to the drawn triangles. `max_points` bounds the points of a region, 0
    lifts the bound; regions that are `finished` get none. Control points that are not `kept` `(n,)` are about
    to be taken out, and not to be put back.
    """
    order = np.argsort(-gain)
    order = order[(where[order] >= 0) & (gain[order] > 0)]
    height, width = blocked.shape
    y, x = np.divmod(where[order], width)
    centre = np.stack([x, y], axis=1) + 0.5
    geometry = canvas.foundation.geometry
    in_domain = (2 * centre - geometry.to_image(centre)).astype(np.int64)
    in_domain = np.clip(in_domain, 0, [width - 1, height - 1])
    patch_at = geometry.patch_at()
    fits = patch_at[in_domain[:, 1], in_domain[:, 0]] == patch[order]
    taken = canvas.mesh.vertices[canvas.mesh.n_samples : canvas.mesh.first_free].astype(np.int64)
    n_patches = len(canvas.foundation.network.loops)
    count = np.bincount(canvas.patch_of_points()[kept], minlength=n_patches)
    limit = max_points or width * height
    count[finished] = limit
    return np.asarray(_pick(in_domain[fits], patch[order][fits], blocked, taken, count, limit, wanted))


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


def room(foundation: Foundation, clearance: float = CLEARANCE) -> NDArray[np.bool_]:
    """Pixels `(h, w)` whose centres keep `clearance` pixels from every polygon edge."""
    network, samples = foundation.network, foundation.samples
    ends = samples.domain[samples.edge_ends]
    return np.asarray(_clear_of(ends, network.width, network.height, clearance))


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


def usefulness(
    vertices: Floats, triangles: Ints, colors: Floats, corner_color: Ints, energy: Floats
) -> Floats:
    """About how much squared error each control point `(n,)` saves.

    Without the point its place would take the colour of a plane through its neighbours' colours, so the
    picture would change by that
    difference times the point's hat function, whose squared sum over the pixels is `energy` `(n,)`. The
    control points are the
    first n of `colors` `(k, 3)`, which `corner_color` `(t, 3)` gives to the corners of the `triangles`.
    """
    return np.asarray(_usefulness(vertices, triangles, np.ascontiguousarray(colors), corner_color, energy))


@njit(cache=True, nogil=True)
def _usefulness(vertices, triangles, colors, corner_color, energy):
    n = len(energy)
    # Weighted moments of the neighbours about the point: 1, x, y, xx, xy, yy, and of their colours: c, cx,
    # cy.
    moments = np.zeros((n, 6))
    sums = np.zeros((n, 3, 3))
    for t in range(len(triangles)):
        for k in range(3):
            point = corner_color[t, k]
            if point >= n:
                continue
            for step in range(1, 3):
                j = (k + step) % 3
                x = vertices[triangles[t, j], 0] - vertices[triangles[t, k], 0]
                y = vertices[triangles[t, j], 1] - vertices[triangles[t, k], 1]
                w = 1.0 / max(x * x + y * y, 1e-6)
                moments[point, 0] += w
                moments[point, 1] += w * x
                moments[point, 2] += w * y
                moments[point, 3] += w * x * x
                moments[point, 4] += w * x * y
                moments[point, 5] += w * y * y
                for c in range(3):
                    value = w * colors[corner_color[t, j], c]
                    sums[point, c, 0] += value
                    sums[point, c, 1] += value * x
                    sums[point, c, 2] += value * y
    result = np.zeros(n)
    matrix = np.empty((3, 3))
    for i in range(n):
        m = moments[i]
        if m[0] == 0.0:
            continue
        matrix[0, 0], matrix[0, 1], matrix[0, 2] = m[0], m[1], m[2]
        matrix[1, 0], matrix[1, 1], matrix[1, 2] = m[1], m[3] + 0.05, m[4]
        matrix[2, 0], matrix[2, 1], matrix[2, 2] = m[2], m[4], m[5] + 0.05
        plane = np.linalg.solve(matrix, sums[i].T.copy())
        for c in range(3):
            result[i] += energy[i] * (colors[i, c] - plane[0, c]) ** 2
    return result
