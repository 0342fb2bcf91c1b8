"""Boundary samples: the points at which curves meet meshes.

Every curve is sampled at its knots and at evenly spaced parameters between them. A sample has a place in the
parameter domain (on the polygon edge) and one in the image (on the curve); both are shared by the regions on
either side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.domain import polygon_edges, sample_numbers
from gcvec.curves.network import Network

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
    sampling, closed, n_nodes = network.sampling, network.family.closed, network.n_nodes
    number, own = sample_numbers(network)
    start = np.array([c.start for c in network.curves])
    end = np.array([c.end for c in network.curves])
    node_control = np.zeros(n_nodes, np.int64)
    node_control[start[~closed]] = network.offsets[:-1][~closed]
    node_control[end[~closed]] = network.offsets[1:][~closed] - 1

    edges = polygon_edges(network)
    at = np.flatnonzero(own)
    a, b = edges[np.searchsorted(edges[:, 0], at, side="right") - 1].T
    along = (sampling.u[at] - sampling.u[a]) / (sampling.u[b] - sampling.u[a])
    domain = sampling.points[a] + along[:, None] * (sampling.points[b] - sampling.points[a])
    is_vertex = (along == 0)[:, None]
    ends = np.where(is_vertex, number[at][:, None], np.stack([number[a], number[b]], axis=1))
    nodes = np.arange(n_nodes)

    step = np.flatnonzero(sampling.curve[:-1] == sampling.curve[1:])
    steps = np.stack([step, step + 1], axis=1)
    return BoundarySamples(
        n_nodes=n_nodes,
        domain=np.concatenate([network.control_points[node_control], domain]),
        control=np.concatenate([np.repeat(node_control[:, None], 4, axis=1), sampling.control[at]]),
        weight=np.concatenate([np.tile([1.0, 0.0, 0.0, 0.0], (n_nodes, 1)), sampling.weight[at]]),
        curve=np.concatenate([np.full(n_nodes, -1), sampling.curve[at]]),
        u=np.concatenate([np.zeros(n_nodes), sampling.u[at]]),
        ends=np.concatenate([np.stack([nodes, nodes], axis=1), ends]),
        along=np.concatenate([np.zeros(n_nodes), along]),
        segments=number[steps],
        segment_curve=sampling.curve[step],
        segment_u=sampling.u[steps],
        edge_ends=number[edges],
        edge_curve=sampling.curve[edges[:, 0]],
        edge_u=sampling.u[edges],
        edge_control=sampling.control[edges],
        edge_weight=sampling.weight[edges],
        offsets=network.offsets,
    )
