"""Boundary samples: the points at which curves meet meshes.

Every curve is sampled at its knots and at evenly spaced parameters between them. A sample has a place in the
parameter domain (on the polygon edge) and one in the image (on the curve); both are shared by the regions on
either side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.boundary import Network
from gcvec.domain import polygon_vertices

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class BoundarySamples:
    """Samples of all curves; the first `n_nodes` are the nodes.

    domain       (n, 2) position on the parameter polygons, pixels
    control      (n, 4) control points that make up a sample, numbered through all curves (`offsets`)
    weight       (n, 4) their weights
    curve        (n,) curve of a sample, -1 for nodes
    u            (n,) its parameter
    ends         (n, 2) the polygon vertices, as samples, on either side of a sample in the domain
    along        (n,) how far between them it lies, 0 for polygon vertices themselves
    segments     (s, 2) consecutive samples along curves
    segment_curve (s,)
    segment_u    (s, 2) parameters of their ends
    edge_ends    (e, 2) samples that are the vertices of each polygon edge
    edge_curve   (e,)
    edge_u       (e, 2) knots at its ends
    edge_control (e, 2, 4) control points that make up the curve at both ends of a polygon edge
    edge_weight  (e, 2, 4)
    offsets      (c + 1,) first control point of each curve
    """

    n_nodes: int
    domain: Floats
    control: Ints
    weight: Floats
    curve: Ints
    u: Floats
    ends: Ints
    along: Floats
    segments: Ints
    segment_curve: Ints
    segment_u: Floats
    edge_ends: Ints
    edge_curve: Ints
    edge_u: Floats
    edge_control: Ints
    edge_weight: Floats
    offsets: Ints

    def __len__(self) -> int:
        return len(self.domain)

    def on_curves(self, control_points: Floats) -> Floats:
        """`(n, 2)` position of every sample in the image, for `control_points` `(c, 2)` of all curves."""
        return np.asarray(np.einsum("nk,nkd->nd", self.weight, control_points[self.control]))


def boundary_samples(network: Network) -> BoundarySamples:
    """Sample every curve of a network."""
    offsets = network.offsets
    node_control = np.full(network.n_nodes, -1)
    for c, curve in enumerate(network.curves):
        if not curve.closed:
            node_control[curve.start] = offsets[c]
            node_control[curve.end] = offsets[c + 1] - 1
    node_at = network.control_points[node_control]

    domain, control, weight, owner, parameter = [node_at], [], [], [], []
    control.append(np.repeat(node_control[:, None], 4, axis=1))
    weight.append(np.tile([1.0, 0.0, 0.0, 0.0], (network.n_nodes, 1)))
    owner.append(np.full(network.n_nodes, -1))
    parameter.append(np.zeros(network.n_nodes))
    ends, along = [np.repeat(np.arange(network.n_nodes)[:, None], 2, axis=1)], [np.zeros(network.n_nodes)]
    segments, segment_curve, segment_u = [], [], []
    edge_ends, edge_curve, edge_u, edge_control, edge_weight = [], [], [], [], []
    n = network.n_nodes
    for c, curve in enumerate(network.curves):
        u, points, w = curve.sampling.u, curve.sampling.points, curve.sampling.weight
        index = offsets[c] + curve.sampling.control
        vertex = polygon_vertices(curve)
        inner = slice(0, -1) if curve.closed else slice(1, -1)
        n_own = len(u) - 1 if curve.closed else len(u) - 2
        ids = np.arange(n, n + n_own)
        walk = np.append(ids, ids[0]) if curve.closed else np.concatenate([[curve.start], ids, [curve.end]])
        edge = np.clip(np.searchsorted(vertex, np.arange(len(u)), side="right") - 1, 0, len(vertex) - 2)[
            inner
        ]
        t = (u[inner] - u[vertex[edge]]) / (u[vertex[edge + 1]] - u[vertex[edge]])
        around = np.stack([walk[vertex[edge]], walk[vertex[edge + 1]]], axis=1)
        domain.append(points[vertex[edge]] + t[:, None] * (points[vertex[edge + 1]] - points[vertex[edge]]))
        control.append(index[inner])
        weight.append(w[inner])
        owner.append(np.full(n_own, c))
        parameter.append(u[inner])
        ends.append(np.where((t == 0)[:, None], ids[:, None], around))
        along.append(t)
        segments.append(np.stack([walk[:-1], walk[1:]], axis=1))
        segment_curve.append(np.full(len(u) - 1, c))
        segment_u.append(np.stack([u[:-1], u[1:]], axis=1))
        edge_ends.append(np.stack([walk[vertex[:-1]], walk[vertex[1:]]], axis=1))
        edge_curve.append(np.full(len(vertex) - 1, c))
        edge_u.append(np.stack([u[vertex[:-1]], u[vertex[1:]]], axis=1))
        edge_control.append(np.stack([index[vertex[:-1]], index[vertex[1:]]], axis=1))
        edge_weight.append(np.stack([w[vertex[:-1]], w[vertex[1:]]], axis=1))
        n += n_own
    return BoundarySamples(
        network.n_nodes,
        np.concatenate(domain),
        np.concatenate(control),
        np.concatenate(weight),
        np.concatenate(owner),
        np.concatenate(parameter),
        np.concatenate(ends),
        np.concatenate(along),
        np.concatenate(segments),
        np.concatenate(segment_curve),
        np.concatenate(segment_u),
        np.concatenate(edge_ends),
        np.concatenate(edge_curve),
        np.concatenate(edge_u),
        np.concatenate(edge_control),
        np.concatenate(edge_weight),
        offsets,
    )
