"""Harmonic coordinates on a triangle mesh (paper, section 3.1; Joshi et al. 2007).

The Laplacian is the P1 cotangent Laplacian. Boundary samples and control points carry Dirichlet rows; the
other vertices are free, and on a constrained Delaunay mesh the discrete maximum principle keeps every
coordinate in [0, 1].
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FADED = 1e-8
"""Coordinates smaller than this count as 0."""

BLOCK = 256
"""Coordinates solved for at once."""

FEW = 300
"""So few free vertices, as most clusters of them have, are solved for densely: that is as fast, and saves
loading the sparse solvers, which takes as long as a small picture does."""


def cotangent_laplacian(vertices: Floats, triangles: Ints) -> sparse.csr_array:
    """Stiffness matrix `(v, v)` of linear elements: symmetric, rows sum to 0, exact for linear functions.

    `vertices` is `(v, 2)`, `triangles` `(t, 3)`; ValueError where their area is not positive.
    """
    n = len(vertices)
    corner = vertices[triangles]
    rows, columns, values = [], [], []
    for k in range(3):
        i, j = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        a = corner[:, (k + 1) % 3] - corner[:, k]
        b = corner[:, (k + 2) % 3] - corner[:, k]
        double_area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        if (double_area <= 0).any():
            raise ValueError("triangles without area")
        half_cotangent = (a * b).sum(axis=1) / (2 * double_area)
        rows += [i, j, i, j]
        columns += [j, i, i, j]
        values += [-half_cotangent, -half_cotangent, half_cotangent, half_cotangent]
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    return sparse.coo_array(entries, shape=(n, n)).tocsr()


def harmonic_extension(laplacian: sparse.csr_array, free: Ints, fixed: Ints, values: Floats) -> Floats:
    """Values `(f, k)` at the vertices `free` of the k harmonic functions that take `values` `(d, k)` at
    `fixed`."""
    if not len(free):
        return np.zeros((0, values.shape[1]))
    rows = laplacian[free]
    return _solver(rows[:, free])(-(rows[:, fixed] @ values))


def faded_coordinates(
    laplacian: sparse.csr_array, free: Ints, fixed: Ints, values: sparse.csr_array
) -> sparse.csr_array:
    """Harmonic coordinates `(f, k)`, at the vertices `free`, that take `values` `(d, k)` at `fixed`.

    Coordinates are ever smaller the more boundary lies between a vertex and their own: those below `FADED`
    are dropped, and the others of their vertex scaled to sum up to 1, so that memory does not grow with the
    product of f and k.
    """
    rows = laplacian[free]
    solve = _solver(rows[:, free])
    right = -(rows[:, fixed] @ values).tocsc()
    blocks = []
    for first in range(0, right.shape[1], BLOCK):
        block = solve(right[:, first : first + BLOCK].toarray())
        block[block < FADED] = 0.0
        blocks.append(sparse.csr_array(block))
    coordinates = sparse.csr_array(sparse.hstack(blocks, "csr"))
    total: Floats = np.asarray(coordinates.sum(axis=1))
    coordinates.data /= np.repeat(total, np.diff(coordinates.indptr))
    return coordinates


def _solver(matrix: sparse.csr_array) -> Callable[[Floats], Floats]:
    """A function that solves for right-hand sides `(n, k)`."""
    if matrix.shape[0] <= FEW:
        dense = matrix.toarray()
        return lambda right: np.asarray(np.linalg.solve(dense, right))
    from scipy.sparse.linalg import splu

    factor = splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    return lambda right: np.asarray(factor.solve(right))


def harmonic_coordinates(
    vertices: Floats, triangles: Ints, edges: Ints, on_edge: Ints, along: Floats, points: Ints
) -> Floats:
    """Harmonic coordinates `(v, n + m)` at every mesh vertex.

    `edges` `(e, 2)` names the mesh vertices that are the ends of each polygon edge; the n distinct ones, in
    increasing order, are the polygon's vertices. Mesh vertex i lies on edge `on_edge[i]` at the fraction
    `along[i]`, or inside where `on_edge[i]` is -1. `points` `(m,)` are the mesh vertices that are control
    points. Columns: vertices, then control points.
    """
    corners = np.unique(edges)
    values = np.zeros((len(vertices), len(corners) + len(points)))
    boundary = np.flatnonzero(on_edge >= 0)
    ends = np.searchsorted(corners, edges[on_edge[boundary]])
    values[boundary, ends[:, 0]] += 1 - along[boundary]
    values[boundary, ends[:, 1]] += along[boundary]
    values[points, len(corners) + np.arange(len(points))] = 1.0
    fixed = np.concatenate([boundary, points])
    is_free = np.ones(len(vertices), bool)
    is_free[fixed] = False
    free = np.flatnonzero(is_free)
    laplacian = cotangent_laplacian(vertices, triangles)
    values[free] = harmonic_extension(laplacian, free, fixed, values[fixed])
    return values
