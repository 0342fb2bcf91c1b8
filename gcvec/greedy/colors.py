"""Colours of control points by least squares, one at a time (Gauss and Seidel), on the pixels of a plot."""

from __future__ import annotations

import numpy as np

from gcvec.greedy.plot import STAMP, corner_of, next_around
from gcvec.kernels import bare_kernel

LEAST_STEP = 0.5 / 255
LEAST_PUSH = 3 / 255
"""Smaller changes of a colour leave what points would save in its triangles as it is, and its neighbours."""


@bare_kernel
def _reach(triangles, neighbors, first, last, pixel, weights, start, vertex, stamp, pixel_mark, phi, touched):
    n, t = 0, start
    while True:
        corner = corner_of(triangles, t, vertex)
        for e in range(first[t], last[t]):
            p = pixel[e]
            # No branches here: they would be hard to predict. What follows a known pixel overwrites it.
            known = pixel_mark[p] == stamp
            pixel_mark[p] = stamp
            phi[p] = weights[e, corner] + (phi[p] if known else np.float32(0.0))
            touched[n] = p
            n += not known
        t = neighbors[t, (corner + 2) % 3]
        if t == start:
            break
    energy = 0.0
    for i in range(n):
        energy += phi[touched[i]] ** 2
    return n, energy


@bare_kernel
def reach(plot, vertex):
    """What a unit of a whole vertex's colour gives to each pixel: `plot.phi` at the pixels
    `plot.touched[:n]`; n and the sum of squares are returned."""
    plot.counts[STAMP] += 1
    return _reach(
        plot.triangles, plot.neighbors, plot.first, plot.last, plot.pixel, plot.weights,
        plot.at_vertex[vertex], vertex, plot.counts[STAMP], plot.pixel_mark, plot.phi, plot.touched,
    )  # fmt: skip


@bare_kernel
def adapt(plot, vertex, pull):
    """Give a whole vertex the best colour in [0, 1] for all others as they are, pulled to that of the photo
    at its seat with the weight `pull` (equation (7))."""
    n, energy = reach(plot, vertex)
    seat = plot.seat[vertex]
    longest = 0.0
    for k in range(3):
        pressure = _pressure(plot.phi, plot.touched, plot.residual, n, k)
        before = plot.color[vertex, k]
        step = (pressure + pull * (plot.photo[seat, k] - before)) / (energy + pull)
        step = min(max(before + step, 0.0), 1.0) - before
        plot.color[vertex, k] = before + step
        _take_off(plot.phi, plot.touched, plot.residual, n, k, step)
        longest = max(longest, abs(step))
    plot.restless[vertex] = False
    if longest > LEAST_STEP:
        _disturb(plot, vertex, longest > LEAST_PUSH)


@bare_kernel
def _disturb(plot, vertex, push):
    """The colour of a vertex has changed: its triangles are stale, and its neighbours may adapt to it."""
    start = plot.at_vertex[vertex]
    t = start
    while True:
        plot.stale[t] = True
        if push:
            plot.restless[plot.triangles[t, (corner_of(plot.triangles, t, vertex) + 1) % 3]] = True
        t = next_around(plot.triangles, plot.neighbors, t, vertex)
        if t == start:
            break


@bare_kernel
def _pressure(phi, touched, residual, n, k):
    total = 0.0
    for i in range(n):
        total += phi[touched[i]] * residual[touched[i], k]
    return total


@bare_kernel
def _take_off(phi, touched, residual, n, k, step):
    for i in range(n):
        residual[touched[i], k] -= phi[touched[i]] * step


@bare_kernel
def usefulness(plot, vertex):
    """About how much squared error a whole vertex saves.

    Without it its place would take the colour of a plane through its neighbours' colours, so the picture
    would change by that difference times what the vertex gives to it.
    """
    _, energy = reach(plot, vertex)
    m0, mx, my, mxx, mxy, myy = 0.0, 0.0, 0.0, 0.05, 0.0, 0.05
    start = plot.at_vertex[vertex]
    t = start
    while True:
        x, y, w, _ = _spoke(plot, t, vertex)
        m0, mx, my = m0 + w, mx + w * x, my + w * y
        mxx, mxy, myy = mxx + w * x * x, mxy + w * x * y, myy + w * y * y
        t = next_around(plot.triangles, plot.neighbors, t, vertex)
        if t == start:
            break
    # Cramer's rule for the plane's value at the vertex itself, a weighted mean of the neighbours'.
    c0, cx, cy = mxx * myy - mxy * mxy, mxy * my - mx * myy, mx * mxy - mxx * my
    determinant = m0 * c0 + mx * cx + my * cy
    lost = 0.0
    for k in range(3):
        plane = 0.0
        while True:
            x, y, w, other = _spoke(plot, t, vertex)
            plane += w * (c0 + cx * x + cy * y) * plot.color[other, k]
            t = next_around(plot.triangles, plot.neighbors, t, vertex)
            if t == start:
                break
        lost += (plot.color[vertex, k] - plane / determinant) ** 2
    return energy * lost


@bare_kernel
def _spoke(plot, t, vertex):
    """A neighbour of a vertex as seen from there, its weight, and which one it is."""
    other = plot.triangles[t, (corner_of(plot.triangles, t, vertex) + 1) % 3]
    x = plot.image[other, 0] - plot.image[vertex, 0]
    y = plot.image[other, 1] - plot.image[vertex, 1]
    return x, y, 1.0 / max(x * x + y * y, 1e-6), other
