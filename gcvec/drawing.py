"""The canonical mesh, taken to the image and tessellated as finely as a rendering needs.

Straight mesh edges along a curve are replaced by polylines on the curve, flat to a tolerance. Both sides
share them, so neighbours meet without gap or overlap at every scale; the mesh on which the coordinates were
solved stays as it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.boundary import Network
from gcvec.mesh import Mesh
from gcvec.samples import BoundarySamples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FLATNESS = 0.015
"""Distance between a drawn polyline and its curve, in output pixels, that nobody sees."""


@dataclass(frozen=True)
class Drawing:
    """Triangles in the image whose corners know where their colours come from.

    image      (v, 2) float64, pixels: the mesh's vertices, then tessellation points on the curves
    triangles  (t, 3) int64
    patch      (t,) int64
    curve      (b,) curve of each boundary vertex, -1 for nodes: samples first, then tessellation points
    control    (b, 4) control points, numbered through all curves, that make up a boundary vertex
    weight     (b, 4)
    n_samples, n_vertices  how the vertices divide: samples, interior vertices of the mesh, tessellation
                           points
    """

    image: Floats
    triangles: Ints
    patch: Ints
    curve: Ints
    control: Ints
    weight: Floats
    n_samples: int
    n_vertices: int

    def boundary_index(self, vertices: Ints) -> Ints:
        """Row in `curve`, `control` and `weight` of boundary vertices."""
        return np.where(vertices < self.n_samples, vertices, vertices - self.n_vertices + self.n_samples)


def draw(
    network: Network,
    samples: BoundarySamples,
    control_points: Floats,
    mesh: Mesh,
    interior: Floats,
    flatness: float,
) -> Drawing:
    """Tessellate the mesh until polylines lie within `flatness` pixels of their curves; infinity: not at all.

    `control_points` `(c, 2)` are those of all curves, `interior` `(v - n_samples, 2)` the places of the
    interior vertices.
    """
    on_curve = samples.on_curves(control_points)
    pieces = _pieces(network, samples, control_points, flatness)
    while True:
        cut = np.flatnonzero(pieces > 1)
        extra = _extra_parameters(samples, cut, pieces[cut])
        curve = np.repeat(samples.segment_curve[cut], pieces[cut] - 1)
        control, weight = network.family.basis(curve, extra)
        first = len(mesh.vertices) + np.cumsum(pieces[cut] - 1) - (pieces[cut] - 1)
        triangles, patch, n_whole = _fan(mesh, samples.segments[cut], first, pieces[cut] - 1)
        between = np.einsum("nk,nkd->nd", weight, control_points[control])
        image = np.concatenate([on_curve, interior, between])
        # Where the polyline would turn a triangle of the fan over, the segment is drawn as its chord.
        fans = triangles[n_whole:]
        corners = fans[folded(image, fans)]
        added = corners[corners >= len(mesh.vertices)]
        if not len(added):
            break
        pieces[cut[np.searchsorted(first, added, side="right") - 1]] = 1
    return Drawing(
        image,
        triangles,
        patch,
        np.concatenate([samples.curve, curve]),
        np.concatenate([samples.control, control]),
        np.concatenate([samples.weight, weight]),
        len(samples),
        len(mesh.vertices),
    )


def folded(image: Floats, triangles: Ints) -> Ints:
    """Triangles `(t, 3)` that S turned over or flattened: the fold-over certificate wants none."""
    a, b, c = (image[triangles[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return np.flatnonzero(ux * vy - uy * vx <= 0)


def _pieces(network: Network, samples: BoundarySamples, control_points: Floats, flatness: float) -> Ints:
    """Into how many pieces each boundary segment is cut: |C''| du^2 / 8 bounds a chord's distance."""
    family, curve, u = network.family, samples.segment_curve, samples.segment_u
    span = np.minimum(u[:, 0].astype(np.int64), family.segments[curve] - 1)
    bend = family.bend(control_points)[family.first_segment[curve] + span]
    bound = bend * (u[:, 1] - u[:, 0]) ** 2 / 8
    return np.maximum(np.ceil(np.sqrt(bound / flatness)), 1).astype(np.int64)


def _extra_parameters(samples: BoundarySamples, cut: Ints, pieces: Ints) -> Floats:
    within = np.arange((pieces - 1).sum()) - np.repeat(np.cumsum(pieces - 1) - (pieces - 1), pieces - 1) + 1
    u = np.repeat(samples.segment_u[cut], pieces - 1, axis=0)
    return np.asarray(u[:, 0] + (u[:, 1] - u[:, 0]) * within / np.repeat(pieces, pieces - 1))


def _fan(mesh: Mesh, segments: Ints, first: Ints, count: Ints) -> tuple[Ints, Ints, int]:
    """Triangles with their edges along `segments` replaced by the polylines through `count` points from
    `first`, their patches, and how many of them, at the beginning, are triangles of the mesh.

    A triangle with such an edge becomes a fan about the opposite corner. One with several is fanned once for
    each: after the first pass each further edge belongs to just one triangle of the fan.
    """
    triangles, patch = mesh.triangles, mesh.patch
    if not len(segments):
        return triangles, patch, len(triangles)
    n = len(mesh.vertices) + int(count.sum())
    keys = np.concatenate([segments[:, 0] * n + segments[:, 1], segments[:, 1] * n + segments[:, 0]])
    order = np.argsort(keys)
    keys = keys[order]
    which, forward = order % len(segments), order < len(segments)

    def fans_of(triangles: Ints) -> tuple[Ints, Ints, Ints]:
        """Those of the triangles that have such an edge, the triangles of their fans, and which of them each
        of these belongs to."""
        edges = triangles * n + np.roll(triangles, -1, axis=1)
        at = np.minimum(np.searchsorted(keys, edges), len(keys) - 1)
        hit = keys[at] == edges
        rows = np.flatnonzero(hit.any(axis=1))
        k = hit[rows].argmax(axis=1)
        at = at[rows, k]
        a, b, apex = triangles[rows, k], triangles[rows, (k + 1) % 3], triangles[rows, (k + 2) % 3]
        number = count[which[at]]
        owner = np.repeat(np.arange(len(rows)), number + 1)
        step = np.arange(len(owner)) - np.repeat(np.cumsum(number + 1) - (number + 1), number + 1)
        along = np.where(forward[at][owner], step, number[owner] - step)
        point = first[which[at]][owner] + along
        start = np.where(step == 0, a[owner], point - np.where(forward[at][owner], 1, 0))
        end = np.where(step == number[owner], b[owner], point - np.where(forward[at][owner], 0, 1))
        return rows, np.stack([start, end, apex[owner]], axis=1), rows[owner]

    # Only triangles with two boundary samples can have such an edge.
    beside = np.flatnonzero((triangles < mesh.n_samples).sum(axis=1) > 1)
    rows, fans, owner = fans_of(triangles[beside])
    parts = [(np.delete(triangles, beside[rows], axis=0), np.delete(patch, beside[rows]))]
    fan_patch = patch[beside[owner]]
    for _ in range(2):
        rows, finer, owner = fans_of(fans)
        parts.append((np.delete(fans, rows, axis=0), np.delete(fan_patch, rows)))
        fans, fan_patch = finer, fan_patch[owner]
    parts.append((fans, fan_patch))
    return (
        np.concatenate([own for own, _ in parts]),
        np.concatenate([of for _, of in parts]),
        len(parts[0][0]),
    )
