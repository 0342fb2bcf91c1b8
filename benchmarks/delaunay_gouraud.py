"""The plainest competitor: a triangulation of the picture with a colour at each vertex.

Starts from the corners; in each round the worst pixel of the worst triangles becomes a vertex, everything is
triangulated anew (Delaunay) and all colours are fitted anew by least squares. There is no file: its bytes are
estimated as log2 of the number of ways to choose the vertices among all pixels, plus the entropy of the
rounded colours' differences from the mean of the neighbours before them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import cg
from scipy.spatial import Delaunay
from scipy.special import gammaln

from benchmarks.pictures import picture

GROWTH = 0.25
"""A round adds at most this share of the vertices there are, less close to the target."""

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def sizes(name: str, megapixels: float, targets: Sequence[float]) -> list[dict[str, Any]]:
    """For each target, largest first, vertices, estimated bytes and error of the first mesh within it.

    Where every pixel with an error is a vertex already, those of the last mesh.
    """
    photo = picture(name, megapixels).astype(float)
    height, width = photo.shape[:2]
    places = np.array([(0, 0), (width - 1, 0), (0, height - 1), (width - 1, height - 1)])
    colors = photo[places[:, 1], places[:, 0]]
    found: list[dict[str, Any]] = []
    while len(found) < len(targets):
        mesh = Delaunay(places)
        weights, triangle = _interpolation(mesh, width, height)
        colors = _fitted(weights, photo.reshape(-1, 3), colors)
        step = 2 * np.sqrt(targets[len(found)] / 5)  # rounding takes a small share of the error
        rounded = np.round(colors / step).astype(np.int64)
        error = ((weights @ (rounded * step)).clip(0, 255) - photo.reshape(-1, 3)) ** 2
        mse = float(error.mean())
        share = min(GROWTH, (mse / targets[len(found)] - 1) / 3)
        taken = places @ [1, width]
        new = _worst_pixels(error.sum(axis=1), triangle, taken, int(share * len(places)) + 8)
        if share <= 0 or not len(new):
            bits = _position_bits(len(places), width * height) + _color_bits(mesh, rounded)
            found.append({"points": len(places), "bytes": int(np.ceil(bits / 8)), "mse": mse})
            continue
        at = np.column_stack([new % width, new // width])
        places, colors = np.concatenate([places, at]), np.concatenate([colors, photo[at[:, 1], at[:, 0]]])
    return found


def _interpolation(mesh: Delaunay, width: int, height: int) -> tuple[sparse.csr_array, Ints]:
    """Barycentric weights `(pixels, vertices)`, and the triangle of every pixel."""
    pixels = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    triangle = mesh.find_simplex(pixels, tol=1e-9).astype(np.int64)
    affine = mesh.transform[triangle]
    first = np.einsum("nij,nj->ni", affine[:, :2], pixels - affine[:, 2])
    weights = np.column_stack([first, 1 - first.sum(axis=1)])
    rows = np.repeat(np.arange(len(pixels)), 3)
    entries = (weights.ravel(), (rows, mesh.simplices[triangle].ravel()))
    return sparse.csr_array(entries, shape=(len(pixels), len(mesh.points))), triangle


def _fitted(weights: sparse.csr_array, wanted: Floats, start: Floats) -> Floats:
    """Least-squares colours, from those of the last round."""
    normal = (weights.T @ weights + 1e-6 * sparse.eye_array(weights.shape[1])).tocsr()
    right = weights.T @ wanted
    channels = [cg(normal, right[:, c], start[:, c], rtol=1e-5, maxiter=200)[0] for c in range(3)]
    return np.column_stack(channels)


def _worst_pixels(error: Floats, triangle: Ints, vertices: Ints, count: int) -> Ints:
    """The worst pixel of each of the `count` triangles whose squared errors sum to most; no vertices."""
    error = error.copy()
    error[vertices] = 0
    by_error = np.argsort(-error, kind="stable")
    _, first = np.unique(triangle[by_error], return_index=True)
    worst = by_error[first]
    total = np.bincount(triangle, error)[triangle[worst]]
    chosen = worst[np.argsort(-total, kind="stable")[:count]]
    return chosen[error[chosen] > 0]


def _position_bits(vertices: int, pixels: int) -> float:
    ways = gammaln(pixels + 1) - gammaln(vertices + 1) - gammaln(pixels - vertices + 1)
    return float(ways / np.log(2))


def _color_bits(mesh: Delaunay, rounded: Ints) -> float:
    """Entropy of each colour's difference from the mean of those neighbours that come before it, by rows."""
    order = np.lexsort((mesh.points[:, 0], mesh.points[:, 1]))
    rank = np.argsort(order)
    start, neighbours = mesh.vertex_neighbor_vertices
    vertex = np.repeat(np.arange(len(rank)), np.diff(start))
    before = rank[neighbours] < rank[vertex]
    links = sparse.csr_array((np.ones(before.sum()), (vertex[before], neighbours[before])), (len(rank),) * 2)
    mean = (links @ rounded) / np.maximum(links.sum(axis=1), 1)[:, None]
    bits = 0.0
    for channel in (rounded - np.round(mean).astype(np.int64)).T:
        _, count = np.unique(channel, return_counts=True)
        bits -= float((count * np.log2(count / count.sum())).sum())
    return bits
