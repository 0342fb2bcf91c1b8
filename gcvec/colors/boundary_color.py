"""Colours along boundary curves (paper, section 4.3): hard and soft edges, offset sampling, bounded fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.borders.planar_graph import OUTSIDE
from gcvec.borders.profile import color_at
from gcvec.colors.least_squares import NormalEquations, solve_bounded
from gcvec.curves.network import Network
from gcvec.curves.spline_family import SplineFamily
from gcvec.kernels import kernel
from gcvec.patches.color_space import LEFT, RIGHT, ColorSpace

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GRADIENT_THRESHOLD = 0.02
DIFFERENCE_THRESHOLD = 0.04
"""An edge is hard where gradient strength G_e and colour difference D_e (both for colours in [0, 1]) exceed
these: 5 and 10 levels of 255. The paper leaves them open. With half of them files of two photos were 1 %
larger at the same error, with twice 2 % smaller."""

SMOOTHNESS = 0.02
"""Weight of the second differences of colour control points along a curve, against one sample."""

SAMPLE_SPACING = 1.0
"""Pixels from sample to sample along a curve, about: more would show the same pixels again."""

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
    family, control = network.family, network.control_points
    knots = np.arange(family.first_segment[-1] + len(family.closed))
    owner = np.repeat(np.arange(len(family.closed)), family.segments + 1)
    knots = knots - (family.first_segment[:-1] + np.arange(len(family.closed)))[owner]
    at_knots = _points(family, control, owner, knots.astype(np.float64))
    chords = np.where(owner[1:] == owner[:-1], np.hypot(*np.diff(at_knots, axis=0).T), 0.0)
    length = np.bincount(owner[:-1], chords, len(family.closed))
    n = np.maximum(np.ceil(length / SAMPLE_SPACING).astype(np.int64), 2 * family.segments)
    curve = np.repeat(np.arange(len(n)), n)
    segments = family.segments[curve]
    u = (np.arange(len(curve)) - np.repeat(np.cumsum(n) - n, n) + 0.5) * segments / n[curve]
    a = _points(family, control, curve, np.maximum(u - 1e-3, 0))
    b = _points(family, control, curve, np.minimum(u + 1e-3, segments))
    tangent = (b - a) / np.maximum(np.hypot(*(b - a).T), 1e-12)[:, None]
    return ColorSamples(curve, u, (a + b) / 2, np.stack([-tangent[:, 1], tangent[:, 0]], axis=1))


def _points(family: SplineFamily, control: Floats, curve: Ints, u: Floats) -> Floats:
    """Points `(n, 2)` of curves at parameters."""
    index, weight = family.basis(curve, u)
    return np.asarray(np.einsum("nk,nkd->nd", weight, control[index]))


def hard_edges(
    network: Network, samples: ColorSamples, picture: Floats, labels: NDArray[np.int32]
) -> NDArray[np.bool_]:
    """Which curves are hard, `(c,) bool`.

    G_e is the median over the curve's samples of the local mean of the Sobel magnitude, D_e the distance
    between the mean colours of the two regions. `picture` is `(h, w, 3)` in [0, 1]. A curve on the frame has
    one side and is soft.
    """
    y, x = _pixel(samples.position, labels.shape)
    strength = medians(gradient_strength(picture, y, x), samples.curve, len(network.curves))
    mean = mean_colors(picture, labels, len(network.loops))
    right, left = network.sides.T
    difference = np.sqrt(((mean[left] - mean[right]) ** 2).mean(axis=1))
    inside = (left != OUTSIDE) & (right != OUTSIDE)
    return np.asarray(inside & (strength > GRADIENT_THRESHOLD) & (difference > DIFFERENCE_THRESHOLD))


def medians(values: Floats, group: Ints, n_groups: int) -> Floats:
    """The median `(n_groups,)` of the values `(n,)` of each group; every group has some."""
    ordered = values[np.lexsort((values, group))]
    count = np.bincount(group, minlength=n_groups)
    first = np.cumsum(count) - count
    return np.asarray((ordered[first + (count - 1) // 2] + ordered[first + count // 2]) / 2)


@kernel
def mean_colors(picture, labels, n_regions):
    """The mean colour `(n, 3)` of every region."""
    total, area = np.zeros((n_regions, 3)), np.zeros(n_regions)
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            area[labels[y, x]] += 1
            for c in range(3):
                total[labels[y, x], c] += picture[y, x, c]
    for k in range(n_regions):
        total[k] /= area[k]
    return total


@kernel
def gradient_strength(picture, ys, xs):
    """The mean over 3 x 3 pixels of the Sobel magnitude, per pixel, at pixels `ys`, `xs` `(n,)`.

    Beyond the frame the picture goes on as it ends there.
    """
    height, width = picture.shape[:2]
    known = np.full((height, width), -1.0)
    strength = np.zeros(len(ys))
    for i in range(len(ys)):
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                y = min(max(ys[i] + dy, 0), height - 1)
                x = min(max(xs[i] + dx, 0), width - 1)
                if known[y, x] < 0:
                    known[y, x] = _sobel(picture, y, x)
                strength[i] += known[y, x] / 9
    return strength


@kernel
def _sobel(picture, y, x):
    """Root mean square over the channels of the Sobel magnitude."""
    height, width = picture.shape[:2]
    up, down = max(y - 1, 0), min(y + 1, height - 1)
    west, east = max(x - 1, 0), min(x + 1, width - 1)
    square = 0.0
    for c in range(3):
        corners = picture[down, east, c] - picture[up, west, c]
        others = picture[up, east, c] - picture[down, west, c]
        gx = (corners + others + 2 * (picture[y, east, c] - picture[y, west, c])) / 4
        gy = (corners - others + 2 * (picture[down, x, c] - picture[up, x, c])) / 4
        square += (gx * gx + gy * gy) / 2
    return np.sqrt(square / 3)


def _pixel(position: Floats, shape: tuple[int, ...]) -> tuple[Ints, Ints]:
    height, width = shape
    x = np.clip(position[:, 0].astype(np.int64), 0, width - 1)
    y = np.clip(position[:, 1].astype(np.int64), 0, height - 1)
    return y, x


@kernel
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
    its own eroded region, the inward offset sampling of section 4.3. A little smoothness settles what no
    sample sees.
    """
    inward = _inward(labels)
    control, weight = network.family.basis(samples.curve, samples.u)
    on_curve = colors_at(picture, samples.position)
    rows, seen = [], []
    for side, outward in ((RIGHT, 1.0), (LEFT, -1.0)):
        region = network.sides[samples.curve, side]
        own = inward[_own_pixel(samples, outward, region, labels)]
        used = region != OUTSIDE
        rows.append(_rows(space.of_control[side][control[used]], weight[used], space.size))
        seen.append(np.where(hard[samples.curve, None], picture.reshape(-1, 3)[own], on_curve)[used])
    smooth = SMOOTHNESS**0.5 * _second_differences(network, space)
    design = sparse.vstack([*rows, smooth]).tocsr()
    target = np.concatenate([*seen, np.zeros((smooth.shape[0], 3))])
    back = design.T.tocsr()
    right, mass = back @ target, back @ np.ones(len(target))
    equations = NormalEquations(
        sparse.eye_array(space.size, format="csr"), design, np.full(space.size, 1e-6), right
    )
    start = np.clip(right / np.maximum(mass, 1e-6)[:, None], 0, 1)
    return solve_bounded(equations, start, 200, 1e-3)


@kernel
def colors_at(picture, position):
    """The picture at places `(n, 2)`, interpolated between pixel centres, clamped at the frame."""
    colors = np.empty((len(position), 3))
    for i in range(len(position)):
        color_at(picture, position[i, 0], position[i, 1], colors[i])
    return colors


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


def _rows(columns: Ints, values: Floats, n_columns: int) -> sparse.csr_array:
    rows = np.repeat(np.arange(len(columns)), columns.shape[1])
    shape = (len(columns), n_columns)
    return sparse.coo_array((values.ravel(), (rows, columns.ravel())), shape=shape).tocsr()


def _second_differences(network: Network, space: ColorSpace) -> sparse.csr_array:
    """Second differences of consecutive colour control points of every curve and side."""
    family = network.family
    size = np.diff(family.offsets)
    owner = np.repeat(np.arange(len(size)), size)
    place = np.arange(family.offsets[-1]) - family.offsets[owner]
    first = np.flatnonzero(family.closed[owner] | (place < size[owner] - 2))
    triples = np.stack(
        [family.offsets[owner[first]] + (place[first] + k) % size[owner[first]] for k in range(3)], axis=1
    )
    columns = np.concatenate(
        [
            space.of_control[side][triples[network.sides[owner[first], side] != OUTSIDE]]
            for side in (RIGHT, LEFT)
        ]
    )
    return _rows(columns, np.tile([1.0, -2.0, 1.0], (len(columns), 1)), space.size)
