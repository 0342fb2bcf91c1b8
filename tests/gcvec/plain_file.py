"""Sections 3 to 6 of `docs/format.md`, in plain Python, from that page alone: what a `.gcv` file holds.

Colours take the mesh of section 7, so it has to be given.
"""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from tests.gcvec.plain_decoder import (
    PlainDecoder,
    PlainModel,
    plain_bitmap,
    plain_class,
    plain_sequence,
    plain_sign,
    plain_text,
)

Point = list[int]
Color = list[int]

COARSEST = 64
"""The stride of boundary colours that cover nothing."""


class PlainCurve(NamedTuple):
    left: int
    right: int
    start: int
    end: int
    level: int
    segments: int
    hard: int

    @property
    def closed(self) -> bool:
        return self.start < 0

    @property
    def on_frame(self) -> bool:
        return self.left < 0 or self.right < 0


class PlainCorrection:
    """Corrected predictions of one axis."""

    def __init__(self, n_features: int) -> None:
        self.coefficients = [0.0] * n_features
        self.powers = [1.0] * n_features

    def __call__(self, features: Sequence[float]) -> float:
        total = 0.0
        for g, v in zip(self.coefficients, features, strict=True):
            total += g * v
        return total

    def learn(self, features: Sequence[float], missing: float) -> None:
        for k, v in enumerate(features):
            self.powers[k] += v * v
            self.coefficients[k] += ((0.15 * missing) * v) / (
                (30 * math.sqrt(self.powers[k]) + (10 * v) * v) + 10
            )


def nearest(value: float) -> int:
    return math.floor(value + 0.5) if abs(value) < 2**30 else 0


def held(value: int) -> int:
    return min(max(value, -(2**30)), 2**30)


class PlainMesh(NamedTuple):
    """The mesh of section 7.

    vertices   in the parameter domain: samples, then interior control points, then free points
    triangles  their corners
    patches    the patch of each triangle
    samples    curve and u of each; for a node -1 and its number
    """

    vertices: list[list[float]]
    triangles: list[list[int]]
    patches: list[int]
    samples: list[tuple[int, float]]


@dataclass
class PlainFile:
    """What a file says about a picture.

    reference, moved  control points of each curve in pixels; `moved` is None unless they were moved
    points            pixels (x, y) of interior control points
    edits             1 if curves were moved, plus 2 if patches were recoloured
    decoder           stands before the colours
    """

    width: int
    height: int
    n_patches: int
    position_bits: int
    boundary_step: int
    point_step: int
    labels: list[str]
    curves: list[PlainCurve]
    reference: list[list[list[float]]]
    moved: list[list[list[float]]] | None
    points: list[tuple[int, int]]
    edits: int
    decoder: PlainDecoder

    def colors(self, mesh: PlainMesh) -> tuple[dict[tuple[int, str], list[Color]], list[Color]]:
        """Coordinates of the control points of each side in the picture, by curve and "right" or "left", and
        of the interior control points."""
        strides = plain_strides(self.curves, mesh)
        boundary = plain_boundary_colors(self.decoder, self.curves, self.n_patches, strides)
        patch_of = {v: p for t, p in zip(mesh.triangles, mesh.patches, strict=True) for v in t}
        numbers = [len(mesh.samples) + i for i in range(len(self.points))]
        of_points = plain_point_colors(
            self.decoder,
            self.points,
            [patch_of[v] for v in numbers],
            self.width,
            [strides[v] for v in numbers],
        )
        return boundary, of_points

    def recolors(self) -> dict[int, list[int]]:
        """The shift of each recoloured patch; only after the colours of points."""
        if not self.edits & 2:
            return {}
        model = PlainModel(inputs=2)
        patch, found = -1, {}
        for _ in range(plain_sequence(self.decoder, 1, model)[0]):
            passed_over, *shift = plain_sequence(self.decoder, 4, model)
            patch += passed_over + 1
            found[patch] = shift
        return found


def plain_file(data: bytes) -> PlainFile:
    decoder = PlainDecoder(data[8:])
    width, height, _, n_curves, n_patches, position_bits, boundary_step, point_step, edits, n_text = (
        plain_sequence(decoder, 10, PlainModel(inputs=2))
    )
    labels = json.loads(plain_text(decoder, n_text).decode())
    curves = plain_topology(decoder, n_curves)
    model = PlainModel(inputs=3)
    reference = plain_control_points(decoder, model, curves, position_bits)
    moved = plain_control_points(decoder, model, curves, position_bits) if edits & 1 else None
    bitmap = plain_bitmap(decoder, height, width)
    points = [(x, y) for y in range(height) for x in range(width) if bitmap[y][x]]
    return PlainFile(
        width,
        height,
        n_patches,
        position_bits,
        boundary_step,
        point_step,
        labels,
        curves,
        reference,
        moved,
        points,
        edits,
        decoder,
    )


def plain_topology(decoder: PlainDecoder, n_curves: int) -> list[PlainCurve]:
    model = PlainModel(inputs=2)

    def integer(kind: str, context: int) -> int:
        always = (kind, "always")
        return model.integer(decoder, [always, (kind, context)], [always], kind)

    def flag(which: int, context: int) -> int:
        return model.decision(decoder, [("always", which), (context, which)], ("flag", which))

    def read_node(which: int, number: str) -> int:
        nonlocal next_node
        read = next_node if flag(which, 0) else next_node - 1 - integer(number, 0)
        next_node = max(next_node, read + 1)
        return read

    def framed() -> int:
        return 1 if left < 0 or right < 0 else 0

    left = right = next_node = segments = hard = went_on = 0
    node = -1
    curves = []
    for _ in range(n_curves):
        goes_on = flag(0, 2 * went_on + framed())
        if goes_on:
            start = end = node
        else:
            before = framed()
            step = integer("A", before)
            left += step
            right += integer("B", 4 * before + min(abs(step), 3))
            start = end = -1 if flag(1, 0) else read_node(2, "C")
        if start >= 0:
            end = read_node(3, "D")
        node, went_on = end, goes_on
        hard = flag(4, 4 * framed() + 2 * went_on + hard)
        segments = integer("F", 16 * (2 * framed() + went_on) + min(plain_class(abs(segments)), 15))
        level = integer("E", 16 * framed() + min(abs(segments), 15))
        curves.append(PlainCurve(left, right, start, end, level, segments, hard))
    return curves


def plain_control_points(
    decoder: PlainDecoder, model: PlainModel, curves: Sequence[PlainCurve], position_bits: int
) -> list[list[list[float]]]:
    corrections = [PlainCorrection(4), PlainCorrection(4)]
    nodes: dict[int, Point] = {}
    last = [0, 0]

    def read_node(node: int) -> Point:
        moved = [0, 0]
        for axis in range(2):
            away = 1 + plain_class(abs(moved[0])) if axis else 0
            kind = ("node", axis)
            sizes = [(kind, 1, 0), (kind, 2, 0), (kind, 3, away)]
            moved[axis] = model.integer(decoder, sizes, [(kind, 4, 0), (kind, 5, 0)], kind)
        return [last[0] + moved[0], last[1] + moved[1]]

    def read_inner(curve: PlainCurve, n: int) -> list[Point]:
        nonlocal last
        stride, earlier, missed_before, surprise = [0, 0], [0, 0], [8, 8], 16
        inner = []
        for i in range(n):
            place = min(i, 3) + (4 if curve.closed else 0)
            size = min(plain_class(abs(missed_before[0]) + abs(missed_before[1])), 15)
            missed, point = [0, 0], [0, 0]
            for axis in range(2):
                if curve.closed:
                    ahead, bend = float(stride[axis]), 0.0
                else:
                    toward = (nodes[curve.end][axis] - last[axis]) / (n - i + 1)
                    ahead = toward if i == 0 else 0.6 * stride[axis] + 0.4 * toward
                    bend = (toward - ahead) / 8
                features = [bend, 0.0, 0.0, missed[0] / 8 if axis else 0.0]
                if i > 0:
                    features[1:3] = earlier[axis] / 8, missed_before[axis] / 8
                guess = last[axis] + nearest(ahead + 8 * corrections[axis](features))
                across = min(plain_class(abs(missed[0])), 15) if axis else 0
                turn = 3 * plain_sign(missed[0]) + plain_sign(missed_before[0]) if axis else 0
                kind = ("inner", axis)
                sizes = [
                    (kind, 1, 0),
                    (kind, 2, 8 * min(plain_class(surprise), 27) + place),
                    (kind, 3, 16 * across + size),
                ]
                signs = [
                    (kind, 4, 9 * plain_sign(missed_before[axis]) + turn),
                    (kind, 5, 3 * plain_sign(stride[axis]) + plain_sign(earlier[axis])),
                ]
                missed[axis] = model.integer(decoder, sizes, signs, kind)
                point[axis] = guess + missed[axis]
                corrections[axis].learn(features, missed[axis] / 8)
            surprise = (surprise + abs(missed[0]) + abs(missed[1])) >> 1
            missed_before, earlier = missed, stride
            stride = [point[0] - last[0], point[1] - last[1]]
            last = point
            inner.append(point)
        return inner

    found = []
    for curve in curves:
        if curve.closed:
            points: list[list[float]] = [list(point) for point in read_inner(curve, curve.segments)]
        else:
            for node in (curve.start, curve.end):
                if node not in nodes:
                    nodes[node] = read_node(node)
                last = nodes[node]
            start, end = nodes[curve.start], nodes[curve.end]
            last = start
            if curve.on_frame:
                points = straight_curve(start, end, curve.segments)
            else:
                points = [list(point) for point in (start, *read_inner(curve, curve.segments + 1), end)]
        found.append([[x * 2.0**-position_bits for x in point] for point in points])
    return found


def straight_curve(start: Sequence[int], end: Sequence[int], segments: int) -> list[list[float]]:
    knots = [min(max(k - 3, 0), segments) for k in range(segments + 7)]
    shares = [sum(knots[k + 1 : k + 4]) / (3 * segments) for k in range(segments + 3)]
    return [[start[axis] + share * (end[axis] - start[axis]) for axis in range(2)] for share in shares]


def shared_corners(curves: Sequence[PlainCurve]) -> dict[tuple[int, int], set[tuple[int, int]]]:
    """For every patch at a node, the patches at nodes whose colour there is the same unknown."""
    corners: dict[tuple[int, int], set[tuple[int, int]]] = {}
    for curve in curves:
        if not curve.closed:
            for node in (curve.start, curve.end):
                for patch in (curve.left, curve.right):
                    corners.setdefault((node, patch), {(node, patch)})
                if not curve.on_frame and not curve.hard:
                    joined = corners[node, curve.left] | corners[node, curve.right]
                    for corner in joined:
                        corners[corner] = joined
    return corners


def unknowns_of(
    curves: Sequence[PlainCurve], corners: dict[tuple[int, int], set[tuple[int, int]]], c: int, side: str
) -> list[Hashable]:
    """The unknowns of the colour control points of a side."""
    curve = curves[c]
    of_side = side if curve.hard or curve.on_frame else "both sides"
    if curve.closed:
        return [(c, of_side, i) for i in range(curve.segments)]
    patch = curve.right if side == "right" else curve.left
    ends = [frozenset(corners[node, patch]) for node in (curve.start, curve.end)]
    return [ends[0], *((c, of_side, i) for i in range(1, curve.segments + 2)), ends[1]]


def plain_strides(curves: Sequence[PlainCurve], mesh: PlainMesh) -> dict[Hashable, int]:
    """The strides of all unknowns on the boundary, and of control points by their number as vertices."""
    corners = shared_corners(curves)
    areas: dict[tuple[int, int], int] = {}
    for triangle, patch in zip(mesh.triangles, mesh.patches, strict=True):
        for k in range(3):
            v, p, q = (triangle[(k + j) % 3] for j in range(3))
            (v_x, v_y), (p_x, p_y), (q_x, q_y) = (mesh.vertices[corner] for corner in (v, p, q))
            double = (p_x - v_x) * (q_y - v_y) - (p_y - v_y) * (q_x - v_x)
            areas[v, patch] = areas.get((v, patch), 0) + math.floor(128 * double + 0.5)
    covered: dict[Hashable, int] = {}
    inside: dict[Hashable, int] = {}
    for (v, patch), area in areas.items():
        if v >= len(mesh.samples):
            inside[v] = area
            continue
        c, u = mesh.samples[v]
        if c < 0:
            shares: list[tuple[Hashable, float]] = [(frozenset(corners[int(u), patch]), 1.0)]
        else:
            curve = curves[c]
            unknowns = unknowns_of(curves, corners, c, "left" if curve.left == patch else "right")
            first, weights = spline_weights(curve, u)
            shares = [(unknowns[(first + k) % len(unknowns)], weight) for k, weight in enumerate(weights)]
        for unknown, weight in shares:
            covered[unknown] = covered.get(unknown, 0) + math.floor(weight * area + 0.5)

    def stride(area: int, coarsest: int) -> int:
        return min(max(math.floor(16 * math.sqrt(16384 / max(area, 1)) + 0.5), 1), coarsest)

    on_boundary = {unknown: stride(area // 2, COARSEST) for unknown, area in covered.items()}
    return on_boundary | {v: stride(area, 96) for v, area in inside.items()}


def spline_weights(curve: PlainCurve, u: float) -> tuple[int, list[float]]:
    """The first of the four control points that make up a curve at u, and their weights."""
    m = curve.segments
    s = min(math.floor(u), m - 1)

    def knot(i: int) -> float:
        return i - 3 if curve.closed else min(max(i - 3, 0), m)

    w = [1.0, 0.0, 0.0, 0.0]
    for j in range(1, 4):
        saved = 0.0
        for r in range(j):
            above, below = knot(s + 4 + r) - u, u - knot(s + 4 - j + r)
            ratio = w[r] / (above + below)
            w[r] = saved + above * ratio
            saved = below * ratio
        w[j] = saved
    return s, w


def plain_boundary_colors(
    decoder: PlainDecoder, curves: Sequence[PlainCurve], n_patches: int, strides: dict[Hashable, int]
) -> dict[tuple[int, str], list[Color]]:
    model = PlainModel(inputs=4)
    corrections = [PlainCorrection(6) for _ in range(3)]
    corners = shared_corners(curves)
    known: dict[Hashable, Color] = {}
    last = [[0, 0, 0] for _ in range(n_patches)]
    met = [0] * n_patches

    found = {}
    for c, curve in enumerate(curves):
        twin: list[Hashable] = []
        for side, patch in (("right", curve.right), ("left", curve.left)):
            if patch < 0:
                continue
            unknowns = unknowns_of(curves, corners, c, side)
            before, change, earlier = last[patch], [0, 0, 0], [0, 0, 0]
            d_before = [8 * strides.get(unknowns[0], COARSEST)] * 3
            for i, unknown in enumerate(unknowns):
                if unknown not in known:
                    place = min(i + 1, 3) if i > 0 else met[patch]
                    stride = strides.get(unknown, COARSEST)
                    if i == 0 and not met[patch]:
                        stride = min(stride, 2)
                    r, q, d = [0, 0, 0], [0, 0, 0], [0, 0, 0]
                    steps_before = [abs(one) // stride for one in d_before]
                    for a in range(3):
                        toward = 0.0
                        if unknowns[-1] in known:
                            toward = (known[unknowns[-1]][a] - before[a]) / 16 / (len(unknowns) - i)
                        other = known[twin[i]][a] - known[twin[i - 1]][a] if twin and i > 0 else 0
                        features = [change[a] / 16, earlier[a] / 16, toward, other / 16]
                        features += [d[k] / 16 if k < a else 0.0 for k in range(2)]
                        prediction = before[a] + nearest(16 * corrections[a](features))
                        b = min(plain_class(size_before(q, a)), 11)
                        sizes = [
                            (a, 1, 4 * min(plain_class(2 * steps_before[a]), 15) + place),
                            (a, 2, 12 * min(plain_class(sum(steps_before)), 15) + b),
                            (a, 3, 4 * b + place),
                            (a, 4, 4 * min(patch, 63) + place),
                        ]
                        turn = plain_sign(before[a] + change[a] - prediction)
                        signs = [
                            (a, 5, 3 * signs_before(q, a) + plain_sign(d_before[a])),
                            (a, 6, 3 * turn + plain_sign(other)),
                        ]
                        q[a] = model.integer(decoder, sizes, signs, a)
                        d[a] = stride * q[a]
                        corrections[a].learn(features, d[a] / 16)
                        r[a] = held(prediction + d[a])
                    known[unknown] = r
                    d_before = d
                met[patch] = 1
                if i > 0:
                    earlier = change
                    change = [new - old for new, old in zip(known[unknown], before, strict=True)]
                before = known[unknown]
            last[patch] = before
            twin = unknowns
            found[c, side] = [known[unknown] for unknown in unknowns]
    return found


def size_before(q: Sequence[int], a: int) -> int:
    """B, of what was read for the axes before."""
    return (0, abs(q[0]), abs(q[1]) + abs(q[0]) // 2)[a]


def signs_before(q: Sequence[int], a: int) -> int:
    return (0, 3 * plain_sign(q[0]), 3 * plain_sign(q[0]) + plain_sign(q[1]))[a]


def plain_point_colors(
    decoder: PlainDecoder,
    points: Sequence[tuple[int, int]],
    patches: Sequence[int],
    width: int,
    strides: Sequence[int],
) -> list[Color]:
    model = PlainModel(inputs=6)
    corrections = [PlainCorrection(19) for _ in range(3)]
    number = {point: i for i, point in enumerate(points)}
    colors: list[Color] = []
    read: list[Color] = []
    kept: list[list[list[float]]] = []
    for i, (x, y) in enumerate(points):
        stride, neighbors = strides[i], nearest_before(points, patches, number, i)
        n, near = len(neighbors), [j for _, j in neighbors]
        shares = [
            kriging_shares([points[j] for j in near], [square for square, _ in neighbors]),
            *averages([(points[j][0] - x, points[j][1] - y) for j in near]),
        ]
        W = [65536 // square for square, _ in neighbors]
        total = 455 + sum(W)
        average, activity, spread = [0, 0, 0], [0, 0, 0], [0, 0, 0]
        for a in range(3):
            average[a] = sum(w * colors[j][a] for w, j in zip(W, near, strict=True)) // total
            surprise = sum(w * abs(read[j][a]) for w, j in zip(W, near, strict=True))
            activity[a] = 4 * surprise // (total * stride) if n else 16
            away = sum(w * abs(colors[j][a] - average[a]) for w, j in zip(W, near, strict=True))
            spread[a] = 4 * away // (total * stride)
        touching = 0
        for dx, dy in ((-1, -1), (0, -1), (1, -1), (-1, 0), (1, 0), (-1, 1), (0, 1), (1, 1)):
            touching = 2 * touching + ((x + dx, y + dy) in number)
        distance = min(plain_class(neighbors[0][0]), 15) if n else 15
        block = ((y >> 5) * ((width >> 5) + 1) + (x >> 5)) % 512
        patch = patches[i]
        # The nearest two, as far as there are any.
        (r_1, d_1), (_, d_2) = [*((colors[j], read[j]) for j in near), *2 * [([0, 0, 0], [0, 0, 0])]][:2]
        r, q, d = [0, 0, 0], [0, 0, 0], [0, 0, 0]
        own: list[list[float]] = []
        for a in range(3):
            offers = [
                ordered_sum(s * (colors[j][a] / 16) for s, j in zip(share, near, strict=True))
                for share in shares
            ]
            votes = []
            for k in range(9):
                error = 1500 + 0.2 * total
                for w, j in zip(W, near, strict=True):
                    error += w * kept[j][a][k]
                for b in range(a):
                    error += (0.1 * total) * own[b][k]
                votes.append(1 / ((error * error) * (error * error)))
            blended = ordered_sum(v * o for v, o in zip(votes, offers, strict=True)) / ordered_sum(votes)
            features = [0.0] * 11 + [offer - offers[0] for offer in offers[1:]]
            if n > 0:
                features[:4] = r_1[a] / 16 - blended, average[a] / 16 - blended, d_1[a] / 16, blended / 5
            features[4] = d_2[a] / 16
            for k in range(a):
                together = sum(w * read[j][k] * read[j][a] for w, j in zip(W, near, strict=True))
                alone = sum(w * read[j][k] ** 2 for w, j in zip(W, near, strict=True))
                features[5 + k] = d[k] / 16
                features[7 + k] = together / (4096 + alone) * d[k] / 16
                features[9 + k] = (r[k] - r_1[k]) / 16
            prediction = nearest((blended + corrections[a](features)) * 16)
            b = min(plain_class(4 * size_before(q, a)) >> 1, 11)
            sizes = [
                (a, 1, block),
                (a, 2, 12 * min(plain_class(sum(activity)) >> 1, 15) + b),
                (a, 3, 16 * min(plain_class(spread[a]), 27) + distance),
                (a, 4, touching),
                (a, 5, 16 * min(stride, 31) + distance),
                (a, 6, 6 * min(patch, 63) + b // 2),
            ]
            beyond = r_1[a] - prediction
            signs = [
                (a, 7, min(plain_class(4 * abs(beyond) // stride), 255) + (256 if beyond > 0 else 0)),
                (a, 8, 9 * (3 * plain_sign(d_1[a]) + plain_sign(d_2[a])) + signs_before(q, a)),
                (a, 9, 9 * min(patch, 54) + signs_before(q, a)),
            ]
            q[a] = model.integer(decoder, sizes, signs, (a, min(plain_class(activity[a]) >> 2, 7)))
            d[a] = stride * q[a]
            corrections[a].learn(features, d[a] / 16)
            r[a] = held(prediction + d[a])
            own.append(
                [(r[a] / 16 - o) ** 2 + (0.1 * own[0][k] if a > 0 else 0) for k, o in enumerate(offers)]
            )
        colors.append(r)
        read.append(d)
        kept.append(own)
    return colors


def ordered_sum(terms: Iterable[float]) -> float:
    """The sum from the first on, each step rounded: what `sum` does differs between versions of Python."""
    total = 0.0
    for term in terms:
        total += term
    return total


def averages(places: Sequence[tuple[int, int]]) -> list[list[float]]:
    """The weights of neighbours that are so far to the right and down, in the average along each vector."""
    found = []
    for a, b in ((1, 0), (2, 1), (1, 1), (1, 2), (0, 1), (-1, 2), (-1, 1), (-2, 1)):
        weights = [1 / ((a * x + b * y) ** 2 + 16 * (a * y - b * x) ** 2) for x, y in places]
        found.append([weight * (1 / ordered_sum(weights)) for weight in weights])
    return found


def nearest_before(
    points: Sequence[tuple[int, int]], patches: Sequence[int], number: dict[tuple[int, int], int], i: int
) -> list[tuple[int, int]]:
    """Square distances and numbers of the neighbours of point i."""
    x, y = points[i]
    found: list[tuple[int, int]] = []
    for ring in range(1, 49):
        if len(found) == 10 and found[9][0] <= ring**2:
            break
        above = [(x + dx, y - ring) for dx in range(-ring, ring + 1)]
        edges = [(x + dx, row) for row in range(y - ring + 1, y + 1) for dx in (-ring, ring)]
        for place in above + edges:
            j = number.get(place, i)
            if j < i and patches[j] == patches[i]:
                found.append(((place[0] - x) ** 2 + (place[1] - y) ** 2, j))
                found = sorted(found, key=lambda neighbor: neighbor[0])[:10]  # which keeps equals in order
    return found


def kriging_shares(near: Sequence[tuple[int, int]], squares: Sequence[int]) -> list[float]:
    n = len(near)
    L = [[0.0] * n for _ in range(n)]
    for a in range(n):
        for b in range(a + 1):
            square = (near[a][0] - near[b][0]) ** 2 + (near[a][1] - near[b][1]) ** 2
            value = 20 / (20 + math.sqrt(square)) if a != b else 1 + 0.02
            for k in range(b):
                value -= L[a][k] * L[b][k]
            L[a][b] = math.sqrt(value) if a == b else value / L[b][b]
    shares = [20 / (20 + math.sqrt(square)) for square in squares]
    for a in range(n):
        for k in range(a):
            shares[a] -= L[a][k] * shares[k]
        shares[a] /= L[a][a]
    for a in range(n - 1, -1, -1):
        for k in range(a + 1, n):
            shares[a] -= L[k][a] * shares[k]
        shares[a] /= L[a][a]
    return shares
