"""Equation (1) of the paper: what the boundary curves of a patch make of its inside.

With v_i = p_i on every polygon it reads

    S(x) = Σ_i λ_i p_i + Σ_i (λ_i + λ_{i+1}) [C_i(t) - (1 - t) p_i - t p_{i+1}],
       t = λ_{i+1} / (λ_i + λ_{i+1}):

the polygon's own interpolation plus the bulge of every curve over its chord, where neither λ is 0. It holds
for geometry and colour alike, and for polygons with holes, where the sum runs over all loops. Both parts are
linear in the control points of the curves.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from gcvec.curves.bspline import spline_weights
from gcvec.curves.spline_family import SplineFamily
from gcvec.kernels import kernel
from gcvec.patches.samples import BoundarySamples

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def coons(
    coordinates: sparse.csr_array, columns: Ints, edges: Ints, family: SplineFamily, samples: BoundarySamples
) -> sparse.csr_array:
    """Weights `(f, c)` of the control points of all curves in S at points with the given coordinates.

    `coordinates` is `(f, n)`; column k belongs to the polygon vertex that is sample `columns[k]`
    (increasing); `edges` are the polygon edges of the patch.
    """
    n_rows, n_columns = coordinates.shape
    n_controls = int(family.offsets[-1])
    if not n_columns:
        return sparse.csr_array((n_rows, n_controls))
    ends = np.minimum(np.searchsorted(columns, samples.edge_ends[edges]), n_columns - 1)
    known = columns[ends] == samples.edge_ends[edges]
    # A node lies on several curves: its colour is that of the curves of this patch.
    corner_control, corner_weight = np.zeros((n_columns, 4), np.int64), np.zeros((n_columns, 4))
    corner_control[ends[known]] = samples.edge_control[edges][known]
    corner_weight[ends[known]] = samples.edge_weight[edges][known]
    both = known.all(axis=1)
    edges, ends = edges[both], ends[both]
    order = np.argsort(ends[:, 0], kind="stable")
    edges, ends = edges[order], ends[order]
    start, controls, weights = _coons(
        coordinates.indptr.astype(np.int64),
        coordinates.indices.astype(np.int64),
        coordinates.data,
        corner_control,
        corner_weight,
        np.searchsorted(ends[:, 0], np.arange(n_columns + 1)),
        np.ascontiguousarray(ends[:, 1]),
        samples.edge_curve[edges],
        samples.edge_u[edges],
        samples.edge_control[edges],
        samples.edge_weight[edges],
        family.offsets,
        family.closed,
    )
    return sparse.csr_array((weights, controls, start), shape=(n_rows, n_controls))


@kernel
def _coons(
    indptr,
    indices,
    data,
    corner_control,
    corner_weight,
    first_edge,
    edge_end,
    edge_curve,
    edge_u,
    edge_control,
    edge_weight,
    offsets,
    closed,
):
    """Compressed rows of weights; the edges that begin at column k are `first_edge[k]` and those after it."""
    n_rows = len(indptr) - 1
    weight_of = np.zeros(len(corner_control))
    total = np.zeros(offsets[-1])
    touched = np.zeros(offsets[-1], np.bool_)
    used = np.empty(offsets[-1], np.int64)
    basis = np.empty(4)
    start = np.zeros(n_rows + 1, np.int32)
    controls = np.empty(1024, np.int32)
    weights = np.empty(1024)
    n_out = 0
    for row in range(n_rows):
        entries = range(indptr[row], indptr[row + 1])
        for entry in entries:
            weight_of[indices[entry]] = data[entry]
        n_used = 0
        for entry in entries:
            a = indices[entry]
            share_a = data[entry]
            for k in range(4):
                n_used = _add(
                    corner_control[a, k], share_a * corner_weight[a, k], total, touched, used, n_used
                )
            for edge in range(first_edge[a], first_edge[a + 1]):
                share_b = weight_of[edge_end[edge]]
                if share_b == 0.0:
                    continue
                c = edge_curve[edge]
                first, n = offsets[c], offsets[c + 1] - offsets[c]
                both = share_a + share_b
                u = edge_u[edge, 0] + (edge_u[edge, 1] - edge_u[edge, 0]) * share_b / both
                segment = spline_weights(u, n if closed[c] else n - 3, closed[c], basis)
                for k in range(4):
                    on_curve = first + (segment + k) % n
                    n_used = _add(on_curve, both * basis[k], total, touched, used, n_used)
                    at_a, at_b = edge_weight[edge, 0, k], edge_weight[edge, 1, k]
                    n_used = _add(edge_control[edge, 0, k], -share_a * at_a, total, touched, used, n_used)
                    n_used = _add(edge_control[edge, 1, k], -share_b * at_b, total, touched, used, n_used)
        for entry in entries:
            weight_of[indices[entry]] = 0.0
        if n_out + n_used > len(controls):
            more_controls = np.empty(2 * (n_out + n_used), np.int32)
            more_weights = np.empty(len(more_controls))
            more_controls[:n_out] = controls[:n_out]
            more_weights[:n_out] = weights[:n_out]
            controls, weights = more_controls, more_weights
        for i in range(n_used):
            control = used[i]
            controls[n_out], weights[n_out] = control, total[control]
            total[control] = 0.0
            touched[control] = False
            n_out += 1
        start[row + 1] = n_out
    return start, controls[:n_out].copy(), weights[:n_out].copy()


@kernel
def _add(control, weight, total, touched, used, n_used):
    """Add to the weight of a control point, listed once in `used`; returns how many are listed."""
    if weight == 0.0:
        return n_used
    if not touched[control]:
        touched[control] = True
        used[n_used] = control
        n_used += 1
    total[control] += weight
    return n_used
