"""Colours of control points by least squares, one at a time (Gauss and Seidel), on the pixels of a strip."""

from __future__ import annotations

import numpy as np

from gcvec.greedy.strip import corner_of, next_around
from gcvec.kernels import bare_kernel

LEAST_STEP = 0.5 / 255
LEAST_PUSH = 3 / 255
"""Smaller changes of a colour leave what points would save in its triangles as it is, and its neighbours."""

NO_STEP = 0.02 / 255
"""Smaller changes are not made."""


@bare_kernel
def adapt(strip, vertex, pull):
    """Give a whole vertex a better colour in [0, 1] for all others as they are, pulled to that of the photo
    at its seat with the weight `pull` (equation (7))."""
    red, green, blue, energy = reach(strip, vertex)
    seat = strip.seat[vertex]
    red = _step(strip.color[vertex, 0], red, strip.photo[seat, 0], energy, pull)
    green = _step(strip.color[vertex, 1], green, strip.photo[seat, 1], energy, pull)
    blue = _step(strip.color[vertex, 2], blue, strip.photo[seat, 2], energy, pull)
    strip.restless[vertex] = False
    longest = max(abs(red), abs(green), abs(blue))
    if longest > NO_STEP:
        strip.color[vertex, 0] += red
        strip.color[vertex, 1] += green
        strip.color[vertex, 2] += blue
        _take_off(
            strip.triangles, strip.neighbors, strip.first, strip.last, strip.pixel, strip.weights,
            strip.residual, strip.at_vertex[vertex], vertex,
            np.float32(red), np.float32(green), np.float32(blue),
        )  # fmt: skip
    if longest > LEAST_STEP:
        _disturb(strip, vertex, longest > LEAST_PUSH)


@bare_kernel
def _step(before, pressure, wanted, energy, pull):
    step = (pressure + pull * (wanted - before)) / (energy + pull)
    return min(max(before + step, 0.0), 1.0) - before


@bare_kernel
def reach(strip, vertex):
    """What a whole vertex's colour has to do with the error: Σ φ r of the three channels, and Σ φ², over the
    pixels, where a unit of it gives φ.

    Σ φ² is summed over the triangles' shares of each pixel, as if every share were one of its own: a little
    more than the square of what they give together, so steps of a colour are a little short of the best.
    """
    return _reach(
        strip.triangles, strip.neighbors, strip.first, strip.last, strip.pixel, strip.weights, strip.residual,
        strip.at_vertex[vertex], vertex,
    )  # fmt: skip


@bare_kernel
def _reach(triangles, neighbors, first, last, pixel, weights, residual, start, vertex):
    red = green = blue = energy = np.float32(0.0)
    t = start
    while True:
        corner = corner_of(triangles, t, vertex)
        for e in range(first[t], last[t]):
            p, phi = pixel[e], weights[e, corner]
            energy += phi * phi / (weights[e, 0] + weights[e, 1] + weights[e, 2])
            red += phi * residual[p, 0]
            green += phi * residual[p, 1]
            blue += phi * residual[p, 2]
        t = neighbors[t, (corner + 2) % 3]
        if t == start:
            break
    return red, green, blue, energy


@bare_kernel
def _take_off(triangles, neighbors, first, last, pixel, weights, residual, start, vertex, red, green, blue):
    t = start
    while True:
        corner = corner_of(triangles, t, vertex)
        for e in range(first[t], last[t]):
            p, phi = pixel[e], weights[e, corner]
            residual[p, 0] -= phi * red
            residual[p, 1] -= phi * green
            residual[p, 2] -= phi * blue
        t = neighbors[t, (corner + 2) % 3]
        if t == start:
            break


@bare_kernel
def _disturb(strip, vertex, push):
    """The colour of a vertex has changed: its triangles are stale, and its neighbours may adapt to it."""
    start = strip.at_vertex[vertex]
    t = start
    while True:
        strip.stale[t] = True
        if push:
            strip.restless[strip.triangles[t, (corner_of(strip.triangles, t, vertex) + 1) % 3]] = True
        t = next_around(strip.triangles, strip.neighbors, t, vertex)
        if t == start:
            break


@bare_kernel
def usefulness(strip, vertex):
    """About how much squared error a whole vertex saves.

    Without it its place would take the colour of a plane through its neighbours' colours, so the picture
    would change by that difference times what the vertex gives to it.
    """
    _, _, _, energy = reach(strip, vertex)
    m0, mx, my, mxx, mxy, myy = 0.0, 0.0, 0.0, 0.05, 0.0, 0.05
    start = strip.at_vertex[vertex]
    t = start
    while True:
        x, y, w, _ = _spoke(strip, t, vertex)
        m0, mx, my = m0 + w, mx + w * x, my + w * y
        mxx, mxy, myy = mxx + w * x * x, mxy + w * x * y, myy + w * y * y
        t = next_around(strip.triangles, strip.neighbors, t, vertex)
        if t == start:
            break
    # Cramer's rule for the plane's value at the vertex itself, a weighted mean of the neighbours'.
    c0, cx, cy = mxx * myy - mxy * mxy, mxy * my - mx * myy, mx * mxy - mxx * my
    determinant = m0 * c0 + mx * cx + my * cy
    lost = 0.0
    for k in range(3):
        plane = 0.0
        while True:
            x, y, w, other = _spoke(strip, t, vertex)
            plane += w * (c0 + cx * x + cy * y) * strip.color[other, k]
            t = next_around(strip.triangles, strip.neighbors, t, vertex)
            if t == start:
                break
        lost += (strip.color[vertex, k] - plane / determinant) ** 2
    return energy * lost


@bare_kernel
def _spoke(strip, t, vertex):
    """A neighbour of a vertex as seen from there, its weight, and which one it is."""
    other = strip.triangles[t, (corner_of(strip.triangles, t, vertex) + 1) % 3]
    x = strip.image[other, 0] - strip.image[vertex, 0]
    y = strip.image[other, 1] - strip.image[vertex, 1]
    return x, y, 1.0 / max(x * x + y * y, 1e-6), other
