"""Colours along boundary curves (paper, section 4.3): hard and soft edges, offset sampling, bounded fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage, sparse
from skimage import filters

from gcvec import bspline
from gcvec.boundary import Network
from gcvec.color_space import LEFT, RIGHT, ColorSpace
from gcvec.least_squares import NormalEquations, solve_bounded
from gcvec.planar_graph import OUTSIDE

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GRADIENT_THRESHOLD = 0.02
DIFFERENCE_THRESHOLD = 0.04
"""An edge is hard where gradient strength G_e and colour difference D_e (both for colours in [0, 1]) exceed
these."""

SMOOTHNESS = 0.02
"""Weight of the second differences of colour control points along a curve, against one sample."""

SAMPLE_SPACING = 1.0

OFFSETS = (0.5, 1.0, 1.5, 2.0)
"""How far off a curve its own side's colour is looked for, pixels."""


@dataclass(frozen=True)
class ColorSamples:
    """About one sample a pixel along every curve.

    curve (n,), u (n,), position (n, 2) and the unit normal (n, 2) that points to the right-hand side.
    """

    curve: Ints
    u: Floats
    position: Floats
    normal: Floats


def color_samples(network: Network) -> ColorSamples:
    curves, parameters, positions, normals = [], [], [], []
    for c, curve in enumerate(network.curves):
        knots = bspline.evaluate(curve.control_points, np.arange(curve.segments + 1.0), curve.closed)
        length = np.hypot(*np.diff(knots, axis=0).T).sum()
        n = max(int(np.ceil(length / SAMPLE_SPACING)), 2 * curve.segments)
        u = (np.arange(n) + 0.5) * curve.segments / n
        a = bspline.evaluate(curve.control_points, np.maximum(u - 1e-3, 0), curve.closed)
        b = bspline.evaluate(curve.control_points, np.minimum(u + 1e-3, curve.segments), curve.closed)
        tangent = (b - a) / np.maximum(np.hypot(*(b - a).T), 1e-12)[:, None]
        curves.append(np.full(n, c))
        parameters.append(u)
        positions.append((a + b) / 2)
        normals.append(np.stack([-tangent[:, 1], tangent[:, 0]], axis=1))
    return ColorSamples(*(np.concatenate(part) for part in (curves, parameters, positions, normals)))


def hard_edges(
    network: Network, samples: ColorSamples, picture: Floats, labels: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Which curves are hard, `(c,) bool`.

    G_e is the median over the curve's samples of the local mean of the Sobel magnitude, D_e the distance
    between the mean colours of
    the two regions. `picture` is `(h, w, 3)` in [0, 1]. A curve on the frame has one side and is soft.
    """
    magnitude = np.sqrt(sum(filters.sobel(picture[..., c]) ** 2 for c in range(3)) / 3)
    local = ndimage.uniform_filter(magnitude, 3)
    at = _pixel(samples.position, labels.shape)
    strength = ndimage.median(local[at], samples.curve, np.arange(len(network.curves)))
    n = len(network.loops)
    flat = labels.ravel()
    area = np.bincount(flat, minlength=n)
    mean = np.stack([np.bincount(flat, picture[..., c].ravel(), n) / area for c in range(3)], axis=1)
    left = np.array([c.left for c in network.curves])
    right = np.array([c.right for c in network.curves])
    difference = np.sqrt(((mean[left] - mean[right]) ** 2).mean(axis=1))
    inside = (left != OUTSIDE) & (right != OUTSIDE)
    return np.asarray(inside & (strength > GRADIENT_THRESHOLD) & (difference > DIFFERENCE_THRESHOLD))


def _pixel(position: Floats, shape: tuple[int, ...]) -> tuple[Ints, Ints]:
    height, width = shape
    x = np.clip(position[:, 0].astype(np.int64), 0, width - 1)
    y = np.clip(position[:, 1].astype(np.int64), 0, height - 1)
    return y, x


@njit(cache=True, nogil=True)
def _inward(labels):
    """For every pixel the nearest pixel, among those reached inside its region, whose 3x3 block is all of
    that region."""
    height, width = labels.shape
    source = np.full((height, width), -1, np.int64)
    queue = np.empty(height * width, np.int64)
    head, tail = 0, 0
    for y in range(height):
        for x in range(width):
            whole = True
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    yy, xx = y + dy, x + dx
                    if 0 <= yy < height and 0 <= xx < width and labels[yy, xx] != labels[y, x]:
                        whole = False
            if whole:
                source[y, x] = y * width + x
                queue[tail] = y * width + x
                tail += 1
    while head < tail:
        y, x = queue[head] // width, queue[head] % width
        head += 1
        for yy, xx in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
            if 0 <= yy < height and 0 <= xx < width and labels[yy, xx] == labels[y, x] and source[yy, xx] < 0:
                source[yy, xx] = source[y, x]
                queue[tail] = yy * width + xx
                tail += 1
    for y in range(height):
        for x in range(width):
            if source[y, x] < 0:
                source[y, x] = y * width + x
    return source


def fit_boundary_colors(
    network: Network,
    space: ColorSpace,
    hard: NDArray[np.bool_],
    samples: ColorSamples,
    picture: Floats,
    labels: NDArray[np.int32],
) -> Floats:
    """Colours `(space.size, 3)` of the boundary unknowns: bounded least squares through the samples.

    Soft curves are sampled on the curve; on hard ones each side takes the colour of the nearest pixel inside
    its
    own eroded region, the inward offset sampling of section 4.3. A little smoothness settles what no sample
    sees.
    """
    colors = picture.reshape(-1, 3)
    inward = _inward(labels)
    sides = np.array([(c.right, c.left) for c in network.curves])
    offsets = network.offsets
    control, weight = _basis_through_curves(network, samples, offsets)
    rows, seen = [], []
    for side, outward in ((RIGHT, 1.0), (LEFT, -1.0)):
        region = sides[samples.curve, side]
        own = inward[_own_pixel(samples, outward, region, labels)]
        on_curve = ndimage.map_coordinates
        soft = np.stack(
            [
                on_curve(picture[..., c], samples.position.T[::-1] - 0.5, order=1, mode="nearest")
                for c in range(3)
            ],
            axis=1,
        )
        used = region != OUTSIDE
        rows.append(_rows(space.of_control[side][control[used]], weight[used], space.size))
        seen.append(np.where(hard[samples.curve, None], colors[own], soft)[used])
    design = sparse.vstack([*rows, SMOOTHNESS**0.5 * _second_differences(network, space, offsets)]).tocsr()
    target = np.concatenate([*seen, np.zeros((design.shape[0] - sum(len(s) for s in seen), 3))])
    equations = NormalEquations(
        sparse.eye_array(space.size, format="csr"), design, np.full(space.size, 1e-6), design.T @ target
    )
    return solve_bounded(equations, np.full((space.size, 3), 0.5), 200, 1e-6)


def _own_pixel(
    samples: ColorSamples, outward: float, region: Ints, labels: NDArray[np.int32]
) -> tuple[Ints, Ints]:
    """The first pixel of its own region that each sample meets on its way off the curve.

    A curve may run a pixel or so beside the label map's border. Where no such pixel is near, the last one
    tried.
    """
    y, x = _pixel(samples.position + OFFSETS[0] * outward * samples.normal, labels.shape)
    for offset in OFFSETS[1:]:
        astray = labels[y, x] != region
        further = _pixel(samples.position + offset * outward * samples.normal, labels.shape)
        y, x = np.where(astray, further[0], y), np.where(astray, further[1], x)
    return y, x


def _basis_through_curves(network: Network, samples: ColorSamples, offsets: Ints) -> tuple[Ints, Floats]:
    control, weight = [], []
    starts = np.searchsorted(samples.curve, np.arange(len(network.curves) + 1))
    for c, curve in enumerate(network.curves):
        index, w = bspline.basis(samples.u[starts[c] : starts[c + 1]], curve.segments, curve.closed)
        control.append(offsets[c] + index)
        weight.append(w)
    return np.concatenate(control), np.concatenate(weight)


def _rows(columns: Ints, values: Floats, n_columns: int) -> sparse.csr_array:
    rows = np.repeat(np.arange(len(columns)), columns.shape[1])
    shape = (len(columns), n_columns)
    return sparse.coo_array((values.ravel(), (rows, columns.ravel())), shape=shape).tocsr()


def _second_differences(network: Network, space: ColorSpace, offsets: Ints) -> sparse.csr_array:
    """Second differences of consecutive colour control points of every curve and side."""
    triples = []
    for c, curve in enumerate(network.curves):
        own = np.arange(offsets[c], offsets[c + 1])
        if curve.closed:
            own = np.concatenate([own, own[:2]])
        for side, patch in ((RIGHT, curve.right), (LEFT, curve.left)):
            if patch != OUTSIDE:
                unknown = space.of_control[side][own]
                triples.append(np.stack([unknown[:-2], unknown[1:-1], unknown[2:]], axis=1))
    columns = np.concatenate(triples)
    return _rows(columns, np.tile([1.0, -2.0, 1.0], (len(columns), 1)), space.size)
