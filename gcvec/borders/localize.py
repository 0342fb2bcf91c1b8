"""Borders at sub-pixel accuracy.

A label map knows a border to a pixel. The photo knows it better: across a clean step the anti-aliased
profile says where between two pixel centres the step lies. Every sample of a border moves along its normal
to where the step of equal area would stand; nodes move to where the borders that end there meet.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.border import Borders
from gcvec.borders.chains import Chains, chains_of
from gcvec.borders.contraction import without_shortest
from gcvec.borders.cutting import cut_at_corners
from gcvec.borders.fairing import faired
from gcvec.borders.junctions import meeting_points
from gcvec.borders.profile import step_shifts
from gcvec.kernels import kernel
from gcvec.parallel import in_shares

Floats = NDArray[np.float64]

PASSES = 3
"""So often before corners are looked for, and after. With two or five of them files of two photos differed by
no more than half a percent."""

LARGEST_SHIFT = 1.5
"""The photo moves no sample further than this, pixels, unless the caller asks for less: a step further off
would lie in what is taken for a side's own colour (`profile.FLANK`)."""

LEAST_TRUST = 0.001
"""What a sample counts that only the label map knows: there waves of a few samples vanish."""

BROAD = 4.0
"""A region that ends within so many pixels of a border is thin there: it may show no flank of its own."""

NODE_SHIFT = 1.25
"""A node may move so many times further, twice: label maps round corners off."""

REMOTE = 6.0
"""Nodes further than this from each other cannot change places, pixels."""

NEIGHBOURS = 5
"""Samples either way that lend their trust to those between and beside them."""

SHADING = 6
"""Samples either way that tell how the sides' shading moves a step."""

DOUBT = 16.0
"""How many times its own variance the square of what they tell must exceed to be believed by half."""

NEAREST = 0.8
"""Nearer to a node, pixels, the photo says nothing about a single border."""

CORNER_BLUR, JUNCTION_BLUR = 2.0, 3.0
"""Further from a node it says nothing about another, where one border turns and where several meet."""


def localized(
    traced: Borders, labels: NDArray[np.int32], picture: Floats, largest_shift: float = LARGEST_SHIFT
) -> tuple[Borders, Borders]:
    """The traced borders, cut at real corners, and the same on the photo's steps.

    `labels` `(h, w)` are those that were traced; `picture` is `(h, w, 3)` in [0, 1]. It moves no sample
    further than `largest_shift` pixels; what smooths the staircases of the label map comes on top, and nodes
    may move further (`NODE_SHIFT`).
    """
    if all(border.on_frame for border in traced.borders):
        return traced, traced
    placed = _on_steps(traced, traced, labels, picture, largest_shift, np.full(len(traced.nodes), np.inf))
    traced, placed = cut_at_corners(*without_shortest(traced, placed), picture, largest_shift)
    return traced, _on_steps(traced, placed, labels, picture, largest_shift, _clearance(placed.nodes))


def _on_steps(
    traced: Borders,
    placed: Borders,
    labels: NDArray[np.int32],
    picture: Floats,
    largest_shift: float,
    clearance: Floats,
) -> Borders:
    """The `placed` borders moved, no further than allowed from where they were `traced`."""
    chains = chains_of(traced)
    origin = chains.joined([border.samples for border in traced.borders])
    points = chains.joined([border.samples for border in placed.borders])
    nodes, trust = placed.nodes, np.zeros(len(points))
    farthest = np.minimum(NODE_SHIFT * largest_shift, clearance)
    sides = np.array([(b.left, b.right) for b in placed.borders])[chains.which[chains.of_sample]]
    blur = np.where(_ends_at_nodes(placed) > 2, JUNCTION_BLUR, CORNER_BLUR)
    for _ in range(PASSES):
        normals = _normals(chains, points)
        thin = _beside_thin(labels, sides, points, normals)
        shift, trust = _steps(chains, picture, points, normals, thin)
        clear = _clear_of_nodes(chains, points, nodes, blur)
        seen = np.where(np.isnan(shift)[:, None], origin, points + shift[:, None] * normals)
        weight = np.maximum(trust, LEAST_TRUST) * clear**2
        points = faired(chains, seen, weight)
        trust = trust * clear
        points = origin + _limited(points - origin, largest_shift * (2 - clear))
        wanted = meeting_points(chains, points, trust, nodes)
        nodes = placed.nodes + _limited(_on_frame(wanted, traced) - placed.nodes, farthest)
        # Next to a node that has moved, borders run straight to it.
        points = faired(chains, chains.with_ends(points, nodes), weight)
    return chains.put_back(placed, nodes, points, _spread(trust, chains.offsets, chains.closed))


@kernel
def _beside_thin(labels, sides, points, normals):
    """Which of the regions to the left and to the right of each point, `sides` `(n, 2)`, are thin there."""
    height, width = labels.shape
    thin = np.zeros(sides.shape, np.bool_)
    for i in range(len(points)):
        for side in range(2):
            away = BROAD * (2 * side - 1)
            x = min(max(int(np.floor(points[i, 0] + away * normals[i, 0])), 0), width - 1)
            y = min(max(int(np.floor(points[i, 1] + away * normals[i, 1])), 0), height - 1)
            thin[i, side] = labels[y, x] != sides[i, side]
    return thin


def _steps(
    chains: Chains, picture: Floats, points: Floats, normals: Floats, thin: NDArray[np.bool_]
) -> tuple[Floats, Floats]:
    """How far along its normal `(n, 2)` each point is from the step, NaN where that cannot be told, and how
    surely there is one.

    Shading of the sides draws steps to where the sides are more alike; it varies slowly along a border, and
    what it does is told from many samples.
    """
    shares = in_shares(lambda a, b: step_shifts(picture, points[a:b], normals[a:b], thin[a:b]), len(points))
    shift, trust, shaded = (np.concatenate(parts) for parts in zip(*shares, strict=True))
    return shift + _running_median(shaded, chains.offsets, chains.closed), trust


@kernel
def _running_median(values, offsets, closed):
    """The median `(n,)` of the values known, not NaN, within `SHADING` samples along the chains, the smaller
    the less sure it is; 0 where they are few."""
    medians = np.zeros(len(values))
    near = np.empty(2 * SHADING + 1)
    for chain in range(len(closed)):
        first, size = offsets[chain], offsets[chain + 1] - offsets[chain]
        for k in range(size):
            count = 0
            for i in range(k - SHADING, k + SHADING + 1):
                if closed[chain] and size > 2 * SHADING:
                    value = values[first + i % size]
                elif 0 <= i < size:
                    value = values[first + i]
                else:
                    continue
                if np.isfinite(value):
                    place = count
                    while place > 0 and near[place - 1] > value:
                        near[place] = near[place - 1]
                        place -= 1
                    near[place] = value
                    count += 1
            if count > SHADING:
                middle = near[(count - 1) // 2]
                spread = near[(3 * count) // 4] - near[count // 4]
                # With `spread` between their quartiles, that is about its variance.
                variance = spread * spread / count
                medians[first + k] = middle**3 / (middle * middle + DOUBT * variance + 1e-12)
    return medians


def _clearance(nodes: Floats) -> Floats:
    """How far nodes can move `(k,)` and yet not change places: less than half-way to the next."""
    return np.asarray(np.maximum(0.45 * _nearest_other(nodes), 0.45))


@kernel
def _nearest_other(nodes):
    """The distance `(k,)` of every node from the nearest other one, infinite if all are `REMOTE`."""
    order = np.argsort(nodes[:, 0])
    nearest = np.full(len(nodes), np.inf)
    for i in range(len(nodes)):
        a = order[i]
        for j in range(i + 1, len(nodes)):
            b = order[j]
            ahead = nodes[b, 0] - nodes[a, 0]
            if ahead >= REMOTE:
                break
            distance = np.hypot(ahead, nodes[b, 1] - nodes[a, 1])
            if distance < REMOTE:
                nearest[a] = min(nearest[a], distance)
                nearest[b] = min(nearest[b], distance)
    return nearest


def _limited(shift: Floats, largest: Floats | float) -> Floats:
    length = np.hypot(*shift.T)
    return np.asarray(shift * np.minimum(1, largest / np.maximum(length, 1e-12))[:, None])


def _on_frame(wanted: Floats, traced: Borders) -> Floats:
    """Places for nodes, those on the frame kept there."""
    size = np.array([traced.width, traced.height])
    fixed = (traced.nodes == 0) | (traced.nodes == size)
    return np.where(fixed, traced.nodes, np.clip(wanted, 0, size))


def _ends_at_nodes(placed: Borders) -> NDArray[np.int64]:
    """How many borders end at each node `(k,)`."""
    ends = [node for b in placed.borders if not b.closed for node in (b.start, b.end)]
    return np.bincount(np.array(ends, np.int64), minlength=len(placed.nodes))


def _clear_of_nodes(chains: Chains, points: Floats, nodes: Floats, blur: Floats) -> Floats:
    """How far each sample counts `(n,)`, given how near its chain's ends are and how far, `(k,)`, their blur
    reaches."""
    ends = chains.nodes[chains.of_sample]
    # The middle third of a short border is all that there is.
    third = chains.size * (0.8 / 3)
    clear = np.ones(len(points))
    for end in ends.T:
        away = np.hypot(*(points - nodes[end]).T)
        reach = np.clip(third, NEAREST + 0.5, blur[end])
        clear = np.minimum(clear, np.clip((away - NEAREST) / (reach - NEAREST), 0, 1) ** 2)
    return np.where(chains.closed[chains.of_sample], 1.0, clear)


@kernel
def _spread(trust, offsets, closed):
    """The trust `(n,)` that the best neighbours lend: between and beside sure samples a border is known."""
    lent = trust.copy()
    for chain in range(len(closed)):
        first, size = offsets[chain], offsets[chain + 1] - offsets[chain]
        for k in range(size):
            for i in range(k - NEIGHBOURS, k + NEIGHBOURS + 1):
                if closed[chain]:
                    lent[first + k] = max(lent[first + k], trust[first + i % size])
                elif 0 <= i < size:
                    lent[first + k] = max(lent[first + k], trust[first + i])
    return lent


def _normals(chains: Chains, points: Floats) -> Floats:
    """Unit normals `(n, 2)`, to the right, from chords over three samples either way."""
    tangent = points[chains.along(3)[0]] - points[chains.along(-3)[0]]
    tangent = tangent / np.maximum(np.hypot(*tangent.T), 1e-12)[:, None]
    return np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
