"""Borders at sub-pixel accuracy.

A label map knows a border to a pixel. The photo knows it better: across a clean step the anti-aliased
profile says where between two pixel centres the step lies. Every sample of a border moves along its normal
to where the step of equal area would stand.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from gcvec.borders import Border, Borders, between_nodes

Floats = NDArray[np.float64]

REACH = 2.5
"""The profile is read this far to either side, pixels."""

PASSES = 3
LARGEST_SHIFT = 1.5
"""No sample moves further than this, pixels, unless the caller asks for less."""

LEAST_STEP = 0.06
"""Least distance between the colours of both sides, of colours in [0, 1]."""

LARGEST_SPREAD = 0.25
"""How far a side's own colours may spread, as a share of the step."""

SMOOTHING = 1.5
"""Standard deviation of the smoothing of shifts along a border, samples."""


def localized(found: Borders, picture: Floats, largest_shift: float = LARGEST_SHIFT) -> Borders:
    """Borders with their samples and nodes on the photo's steps.

    `picture` is `(h, w, 3)` in [0, 1]; no sample or node moves further than `largest_shift` pixels.
    """
    nodes = found.nodes
    moved = list(found.borders)
    for number in range(PASSES):
        pulls = _NodePulls(len(nodes))
        for k, border in enumerate(moved):
            if border.on_frame or len(border.samples) < 5:
                continue
            inner = border.samples[:-1] if border.closed else border.samples[1:-1]
            normals = _normals(border)
            shift, trust = _shifts(picture, inner, normals)
            # The first pass takes out the staircase of the label map, sample by sample.
            if number > 0:
                shift = _smoothed(shift, trust, border.closed)
            placed = inner + shift[:, None] * normals
            origin = found.borders[k].samples
            origin = origin[:-1] if border.closed else origin[1:-1]
            placed = origin + _limited(placed - origin, largest_shift)
            if not border.closed:
                pulls.add(border.start, normals[0], shift[0], trust[:4].mean())
                pulls.add(border.end, normals[-1], shift[-1], trust[-4:].mean())
            moved[k] = replace(border, samples=_with_ends(placed, border))
        pulled = nodes + pulls.shifts(nodes, found.width, found.height)
        nodes = found.nodes + _limited(pulled - found.nodes, largest_shift)
        moved = [between_nodes(border, nodes) for border in moved]
    return replace(found, nodes=nodes, borders=tuple(moved))


def _limited(shift: Floats, largest: float) -> Floats:
    length = np.hypot(*shift.T)
    return np.asarray(shift * np.minimum(1, largest / np.maximum(length, 1e-12))[:, None])


def _with_ends(inner: Floats, border: Border) -> Floats:
    if border.closed:
        return np.concatenate([inner, inner[:1]])
    return np.concatenate([border.samples[:1], inner, border.samples[-1:]])


def _normals(border: Border) -> Floats:
    """Unit normals `(n, 2)` at the inner samples, to the right, from chords over three samples either way."""
    points = border.samples
    if border.closed:
        ring = points[:-1]
        tangent = np.roll(ring, -3, axis=0) - np.roll(ring, 3, axis=0)
    else:
        index = np.arange(1, len(points) - 1)
        tangent = points[np.minimum(index + 3, len(points) - 1)] - points[np.maximum(index - 3, 0)]
    tangent = tangent / np.maximum(np.hypot(*tangent.T), 1e-12)[:, None]
    return np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)


def _smoothed(shift: Floats, trust: Floats, closed: bool) -> Floats:
    """Shifts averaged along the border, weighted by trust; untrusted stretches stay where they are."""
    mode: Literal["wrap", "nearest"] = "wrap" if closed else "nearest"
    weight = ndimage.gaussian_filter1d(trust, SMOOTHING, mode=mode)
    total = ndimage.gaussian_filter1d(trust * shift, SMOOTHING, mode=mode)
    return np.asarray(total / np.maximum(weight, 0.25))


@njit(cache=True, nogil=True)
def _color_at(picture, x, y, out):
    """Bilinear interpolation between pixel centres, clamped at the frame."""
    height, width = picture.shape[:2]
    x = min(max(x - 0.5, 0.0), width - 1.0)
    y = min(max(y - 0.5, 0.0), height - 1.0)
    x0, y0 = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
    s, t = x - x0, y - y0
    for c in range(picture.shape[2]):
        top = (1 - s) * picture[y0, x0, c] + s * picture[y0, x1, c]
        bottom = (1 - s) * picture[y1, x0, c] + s * picture[y1, x1, c]
        out[c] = (1 - t) * top + t * bottom


@njit(cache=True, nogil=True)
def _shifts(picture, points, normals):
    """Where along its normal each sample should stand, and whether to trust that (0 or 1)."""
    per_side = 10
    step = REACH / per_side
    n_profile = 2 * per_side + 1
    profile = np.empty((n_profile, 3))
    low, high = np.empty(3), np.empty(3)
    shift, trust = np.zeros(len(points)), np.zeros(len(points))
    for i in range(len(points)):
        for k in range(n_profile):
            offset = (k - per_side) * step
            _color_at(
                picture,
                points[i, 0] + offset * normals[i, 0],
                points[i, 1] + offset * normals[i, 1],
                profile[k],
            )
        flat = 5
        square, spread = 0.0, 0.0
        for c in range(3):
            low[c] = profile[:flat, c].mean()
            high[c] = profile[n_profile - flat :, c].mean()
            square += (high[c] - low[c]) ** 2
            for k in range(flat):
                spread += (profile[k, c] - low[c]) ** 2 + (profile[n_profile - 1 - k, c] - high[c]) ** 2
        if square < 3 * LEAST_STEP**2 or spread / (2 * flat) > LARGEST_SPREAD**2 * square:
            continue
        # The share of the far colour, integrated over the profile, is the length that lies beyond the step.
        beyond = 0.0
        for k in range(n_profile):
            share = 0.0
            for c in range(3):
                share += (profile[k, c] - low[c]) * (high[c] - low[c])
            share = min(max(share / square, 0.0), 1.0)
            beyond += share * (0.5 if k == 0 or k == n_profile - 1 else 1.0) * step
        shift[i] = REACH - beyond
        trust[i] = 1.0
    return shift, trust


class _NodePulls:
    """Least-squares places for nodes: each border at a node asks it to move by a shift along its normal."""

    def __init__(self, n: int) -> None:
        self.matrix = np.tile(0.3 * np.eye(2), (n, 1, 1))
        self.right = np.zeros((n, 2))

    def add(self, node: int, normal: Floats, shift: float, trust: float) -> None:
        self.matrix[node] += trust * np.outer(normal, normal)
        self.right[node] += trust * shift * normal

    def shifts(self, nodes: Floats, width: int, height: int) -> Floats:
        """Shifts `(n, 2)`; nodes on the frame stay on it."""
        shift = np.linalg.solve(self.matrix, self.right[..., None])[..., 0]
        for axis, size in ((0, width), (1, height)):
            on_edge = (nodes[:, axis] == 0) | (nodes[:, axis] == size)
            shift[on_edge, axis] = 0.0
        return np.asarray(shift)
