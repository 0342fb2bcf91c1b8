"""The canonical mesh, taken to the image and tessellated as finely as a rendering needs.

Straight mesh edges along a curve are replaced by polylines on the curve, flat to a tolerance. Both sides
share them, so neighbours meet without gap or overlap at every scale; the mesh on which the coordinates were
solved stays as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.network import Network
from gcvec.kernels import kernel
from gcvec.patches.fans import fans
from gcvec.patches.mesh import Mesh
from gcvec.patches.samples import BoundarySamples
from gcvec.patches.segment_table import SegmentTable, segment_table
from gcvec.raster.triangle import double_area

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FLATNESS = 0.01
"""Distance between a drawn polyline and its curve, in output pixels, that nobody sees."""


@dataclass(frozen=True)
class Drawing:
    """Triangles in the image whose corners know where their colours come from.

    image      (v, 2) float64, pixels: the mesh's vertices, then tessellation points on the curves
    triangles  (t, 3) int64
    patch      (t,) int64
    ends       (e, 2) int64, the samples around each tessellation point, and
    along      (e,) how far between them it lies: so is its colour, at every scale
    n_samples, n_vertices  how the vertices divide: samples, interior vertices of the mesh, tessellation
                           points
    """

    image: Floats
    triangles: Ints
    patch: Ints
    ends: Ints
    along: Floats
    n_samples: int
    n_vertices: int


@dataclass(frozen=True)
class Polylines:
    """The curves of a picture, tessellated: the points between the samples at which meshes meet them.

    table    the segments between consecutive samples
    count    (s,) how many points there are between the ends of each
    segment  (n,) the segment of each point, in order
    along    (n,) how far between the segment's ends it lies
    points   (n, 2) where
    """

    table: SegmentTable
    count: Ints
    segment: Ints
    along: Floats
    points: Floats


def polylines(
    network: Network, samples: BoundarySamples, control_points: Floats, flatness: float
) -> Polylines:
    """The polylines that lie within `flatness` pixels of the curves with control points `(c, 2)`; infinity:
    without any points between samples."""
    count = _pieces(network, samples, control_points, flatness) - 1
    segment, along = _between_samples(count)
    start, end = samples.segment_u[segment].T
    control, weight = network.family.basis(samples.segment_curve[segment], start + (end - start) * along)
    points = np.einsum("nk,nkd->nd", weight, control_points[control])
    return Polylines(segment_table(samples.segments, len(samples)), count, segment, along, points)


def draw(choices: Sequence[Polylines], mesh: Mesh, places: Floats) -> Drawing:
    """A mesh whose vertices S takes to `places` `(v, 2)`, with the curves drawn as polylines.

    Each segment between samples is drawn as the first of the `choices` that turns no triangle of its fans
    over, and as its chord where all of them do.
    """
    table, choice = choices[0].table, np.zeros(len(choices[0].count), np.int64)
    while True:
        count, segment, along, points = _chosen(choices, choice)
        image = np.concatenate([places, points])
        fan, owner = fans(mesh.triangles, table, len(places) + np.cumsum(count) - count, count)
        corners = fan[folded(image, fan)]
        added = corners[corners >= len(places)]
        if not len(added):
            break
        choice[np.unique(segment[added - len(places)])] += 1
    whole = np.ones(len(mesh.triangles), bool)
    whole[owner] = False
    return Drawing(
        image,
        np.concatenate([mesh.triangles[whole], fan]),
        np.concatenate([mesh.patch[whole], mesh.patch[owner]]),
        table.ends[segment],
        along,
        mesh.n_samples,
        len(places),
    )


def _chosen(choices: Sequence[Polylines], choice: Ints) -> tuple[Ints, Ints, Floats, Floats]:
    """How many points each segment `(s,)` has, and segment, place along it and position of each of them,
    where every segment is drawn as the polyline it has chosen, and as its chord where the number is past
    them."""
    used = [choice[lines.segment] == k for k, lines in enumerate(choices)]
    segment, along, points = (
        np.concatenate([getattr(lines, name)[own] for lines, own in zip(choices, used, strict=True)])
        for name in ("segment", "along", "points")
    )
    order = np.argsort(segment, kind="stable")
    count = np.bincount(segment, minlength=len(choice))
    return count, segment[order], along[order], points[order]


def folded(image: Floats, triangles: Ints) -> Ints:
    """Triangles `(t, 3)` that S turned over or flattened: the fold-over certificate wants none."""
    return np.flatnonzero(_is_folded(image, triangles))


@kernel
def _is_folded(image, triangles):
    result = np.empty(len(triangles), np.bool_)
    for t in range(len(triangles)):
        result[t] = double_area(image, triangles[t, 0], triangles[t, 1], triangles[t, 2]) <= 0
    return result


def _pieces(network: Network, samples: BoundarySamples, control_points: Floats, flatness: float) -> Ints:
    """Into how many pieces each boundary segment is cut: |C''| du^2 / 8 bounds a chord's distance."""
    family, curve, u = network.family, samples.segment_curve, samples.segment_u
    span = np.minimum(u[:, 0].astype(np.int64), family.segments[curve] - 1)
    bend = family.bend(control_points)[family.first_segment[curve] + span]
    bound = bend * (u[:, 1] - u[:, 0]) ** 2 / 8
    return np.maximum(np.ceil(np.sqrt(bound / flatness)), 1).astype(np.int64)


def _between_samples(count: Ints) -> tuple[Ints, Floats]:
    """Of `count` `(s,)` points that cut each segment evenly, the segments, and how far along they are."""
    segment = np.repeat(np.arange(len(count)), count)
    within = np.arange(len(segment)) - (np.cumsum(count) - count)[segment] + 1
    return segment, within / (count[segment] + 1)
