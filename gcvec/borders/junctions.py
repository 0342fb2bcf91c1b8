"""Where nodes belong: in the point that the borders which end there point at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.chains import Chains
from gcvec.kernels import kernel

Floats = NDArray[np.float64]

FAR = 10.0
"""A border's direction at its end is that of its samples no further from the node, pixels."""

SAMPLES = 14
"""How many there are at most: 0.7 pixels apart, as on the steepest staircase, they reach `FAR`."""

STIFFNESS = 3.0
"""Weight of the squared bend of the parabola through them over a border that reaches so far, against the
squares of distances."""

OUTLIER = 0.3
"""So far off the parabola, pixels, a sample counts half, and further off still less."""

SWEEPS = 3
"""So often the parabola is fitted, at first by trust alone, then without what lay off the one before."""

INERTIA = 0.1
"""Weight of the squared way that a node moves, against the squared distance of one sure border."""


def meeting_points(chains: Chains, points: Floats, trust: Floats, nodes: Floats) -> Floats:
    """Places `(k, 2)` for the nodes: nearest, by least squares, to the tangents of the borders there.

    A border's weight falls with the trust in its samples; a node without one stays.
    """
    open_ = np.flatnonzero(~chains.closed)
    first, last = chains.offsets[open_], chains.offsets[open_ + 1] - 1
    return np.asarray(_meeting_points(first, last, chains.nodes[open_], points, trust, nodes))


@kernel
def _meeting_points(first, last, ends, points, trust, nodes):
    # Of every node the matrix, xx, xy, yy, and the right-hand side of its normal equations.
    xx, xy, yy = np.full(len(nodes), INERTIA), np.zeros(len(nodes)), np.full(len(nodes), INERTIA)
    right = np.zeros(nodes.shape)
    tangent = np.empty(4)
    for k in range(len(first)):
        for end in range(2):
            at = ends[k, end]
            count = min(SAMPLES, last[k] - first[k] - 1)
            own = np.arange(1, count + 1)
            own = first[k] + own if end == 0 else last[k] - own
            weight = end_tangent(points[own], trust[own], nodes[at], tangent)
            nx, ny = tangent[2], tangent[3]
            distance = (tangent[0] - nodes[at, 0]) * nx + (tangent[1] - nodes[at, 1]) * ny
            xx[at] += weight * nx * nx
            xy[at] += weight * nx * ny
            yy[at] += weight * ny * ny
            right[at, 0] += weight * distance * nx
            right[at, 1] += weight * distance * ny
    placed = np.empty(nodes.shape)
    for at in range(len(nodes)):
        determinant = xx[at] * yy[at] - xy[at] * xy[at]
        placed[at, 0] = nodes[at, 0] + (yy[at] * right[at, 0] - xy[at] * right[at, 1]) / determinant
        placed[at, 1] = nodes[at, 1] + (xx[at] * right[at, 1] - xy[at] * right[at, 0]) / determinant
    return placed


@kernel
def end_tangent(samples, trust, node, tangent):
    """Fill `tangent` with a point, x and y, on the tangent of a border at its end, and the unit normal there;
    returns how surely it is known, in [0, 1].

    `samples` `(n, 2)` are the border's next to the `node`, the nearest first. They are followed by a parabola
    across the direction in which they lie; those far off it lose their weight.
    """
    n = len(samples)
    weight, s, d = np.zeros(n), np.zeros(n), np.zeros(n)
    total, x, y = 0.0, 0.0, 0.0
    for i in range(n):
        away = np.hypot(samples[i, 0] - node[0], samples[i, 1] - node[1])
        weight[i] = trust[i] * min(max(FAR - away, 0.0), 1.0)
        total += weight[i]
        x += weight[i] * samples[i, 0]
        y += weight[i] * samples[i, 1]
    dx, dy = x / max(total, 1e-12) - node[0], y / max(total, 1e-12) - node[1]
    length = max(np.hypot(dx, dy), 1e-12)
    dx, dy = dx / length, dy / length
    reach = 1.0
    for i in range(n):
        x, y = samples[i, 0] - node[0], samples[i, 1] - node[1]
        s[i], d[i] = x * dx + y * dy, y * dx - x * dy
        if weight[i] > 0:
            reach = max(reach, s[i])
    a, b, c = 0.0, 0.0, 0.0
    believed = weight.copy()
    stiffness = STIFFNESS * (FAR / reach) ** 4
    for _ in range(SWEEPS):
        a, b, c = _parabola(s, d, believed, stiffness)
        total = 0.0
        for i in range(n):
            off = d[i] - (a + b * s[i] + c * s[i] * s[i])
            believed[i] = weight[i] / (1 + (off / OUTLIER) ** 2)
            total += believed[i]
    tangent[0], tangent[1] = node[0] - a * dy, node[1] + a * dx
    length = np.hypot(1.0, b)
    tangent[2], tangent[3] = (-dy - b * dx) / length, (dx - b * dy) / length
    # A handful of sure samples make a sure border.
    return min(max((total - 0.5) / 4, 0.0), 1.0)


@kernel
def _parabola(s, d, weight, stiffness):
    """The a, b and c of the parabola a + b s + c s² through d, in weighted least squares with a stiff c."""
    m0, m1, m2, m3, m4 = 1e-9, 0.0, 0.0, 0.0, stiffness
    r0, r1, r2 = 0.0, 0.0, 0.0
    for i in range(len(s)):
        w, x = weight[i], s[i]
        m0 += w
        m1 += w * x
        m2 += w * x * x
        m3 += w * x**3
        m4 += w * x**4
        r0 += w * d[i]
        r1 += w * d[i] * x
        r2 += w * d[i] * x * x
    # LDLᵀ of the 3 x 3 matrix.
    l1, l2 = m1 / m0, m2 / m0
    e1 = m2 + 1e-6 - l1 * m1
    l3 = (m3 - l2 * m1) / e1
    e2 = m4 - l2 * m2 - l3 * l3 * e1
    y1 = r1 - l1 * r0
    y2 = r2 - l2 * r0 - l3 * y1
    c = y2 / e2
    b = y1 / e1 - l3 * c
    a = r0 / m0 - l1 * b - l2 * c
    return a, b, c
