"""Where nodes belong: in the point that the borders which end there point at."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.chains import Chains

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FAR = 10.0
"""A border's direction at its end is that of its samples no further from the node, pixels."""

SAMPLES = 14
STIFFNESS = 3.0
"""Weight of the squared bend of the parabola through them over a border that reaches so far, against the
squares of distances."""

SWEEPS = 3
OUTLIER = 0.3
"""Samples that lie further off the parabola, pixels, lose their weight."""

INERTIA = 0.1
"""Weight of the squared way that a node moves, against the squared distance of one sure border."""


def meeting_points(chains: Chains, points: Floats, trust: Floats, nodes: Floats) -> Floats:
    """Places `(k, 2)` for the nodes: nearest, by least squares, to the tangents of the borders there.

    A border's weight falls with the trust in its samples; a node without one stays.
    """
    at, foot, normal, weight = _tangents(chains, points, trust, nodes)
    matrix = np.tile(INERTIA * np.eye(2), (len(nodes), 1, 1))
    right = np.zeros((len(nodes), 2))
    distance = ((foot - nodes[at]) * normal).sum(axis=1)
    np.add.at(matrix, at, weight[:, None, None] * normal[:, :, None] * normal[:, None, :])
    np.add.at(right, at, (weight * distance)[:, None] * normal)
    return np.asarray(nodes + np.linalg.solve(matrix, right[..., None])[..., 0])


def _tangents(
    chains: Chains, points: Floats, trust: Floats, nodes: Floats
) -> tuple[Ints, Floats, Floats, Floats]:
    """For every end of an open chain its node, a point on its tangent there, the normal and the weight."""
    first, last = chains.offsets[:-1][~chains.closed], chains.offsets[1:][~chains.closed] - 1
    at = chains.nodes[~chains.closed].T.ravel()
    steps = np.arange(1, SAMPLES + 1)
    index = np.concatenate([first[:, None] + steps, last[:, None] - steps])
    inner = np.concatenate([index[: len(first)] < last[:, None], index[len(first) :] > first[:, None]])
    index = np.where(inner, index, np.concatenate([first, last])[:, None])
    node = nodes[at]
    own = points[index]
    away = np.hypot(*np.moveaxis(own - node[:, None], -1, 0))
    weight = trust[index] * inner * np.clip(FAR - away, 0, 1)
    total = weight.sum(axis=1)
    safe = np.maximum(total, 1e-12)[:, None]
    middle = (weight[..., None] * own).sum(axis=1) / safe
    direction = middle - node
    direction /= np.maximum(np.hypot(*direction.T), 1e-12)[:, None]
    normal = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
    # A parabola across this direction, the node's place as origin.
    s = ((own - node[:, None]) * direction[:, None]).sum(axis=-1)
    d = ((own - node[:, None]) * normal[:, None]).sum(axis=-1)
    design = np.stack([np.ones_like(s), s, s * s], axis=-1)
    reach = np.maximum((s * (weight > 0)).max(axis=1), 1)
    ridge = np.zeros((len(node), 3, 3))
    ridge[:, 0, 0], ridge[:, 1, 1] = 1e-9, 1e-6
    ridge[:, 2, 2] = STIFFNESS * (FAR / reach) ** 4
    believed = weight
    for _ in range(SWEEPS):
        matrix = ridge + np.einsum("en,eni,enj->eij", believed, design, design)
        right = np.einsum("en,eni,en->ei", believed, design, d)
        a, b, c = np.linalg.solve(matrix, right[..., None])[..., 0].T
        off = d - (a[:, None] + b[:, None] * s + c[:, None] * s * s)
        believed = weight / (1 + (off / OUTLIER) ** 2)
    total = believed.sum(axis=1)
    foot = node + a[:, None] * normal
    tilted = normal - b[:, None] * direction
    tilted /= np.hypot(*tilted.T)[:, None]
    # A handful of sure samples make a sure border.
    sure = np.clip((total - 0.5) / 4, 0, 1)
    return at, foot, tilted, sure
