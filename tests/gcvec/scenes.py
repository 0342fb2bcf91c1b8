"""Made label maps and pictures whose truth is known."""

from __future__ import annotations

from functools import cache

import numpy as np

from gcvec.borders import borders
from gcvec.boundary_fit import fitted_network
from gcvec.canonical import Foundation, lay_unfolded_foundation
from gcvec.components import connected_components
from gcvec.planar_graph import planar_graph


def _disc(shape: tuple[int, int], centre: tuple[float, float], radius: float) -> np.ndarray:
    y, x = np.mgrid[: shape[0], : shape[1]]
    return np.asarray(np.hypot(x + 0.5 - centre[0], y + 0.5 - centre[1]) < radius)


def _ring() -> np.ndarray:
    labels = np.zeros((200, 220), np.int32)
    labels[_disc(labels.shape, (112, 98), 90)] = 1
    labels[_disc(labels.shape, (120, 90), 20)] = 2
    return labels


def _quadrants() -> np.ndarray:
    y, x = np.mgrid[:150, :170]
    return np.asarray((x >= 82) + 2 * (y >= 70), np.int32)


def _diagonal() -> np.ndarray:
    """Two regions that touch in one lattice point, on a third that they cut in two."""
    labels = np.zeros((24, 24), np.int32)
    labels[4:12, 4:12] = 1
    labels[12:20, 12:20] = 2
    return labels


def _stripes() -> np.ndarray:
    """Regions one and two pixels wide, straight, stepped and bent."""
    labels = np.zeros((40, 48), np.int32)
    labels[6, 4:44] = 1
    labels[12:14, 3:45] = 2
    for k in range(30):
        labels[18 + k // 3, 5 + k] = 3
        labels[18 + (k + 1) // 3, 5 + k] = 3
    labels[34, 4:20] = 4
    labels[28:35, 4] = 4
    return labels


def voronoi(height: int, width: int, n: int, seed: int) -> np.ndarray:
    """Nearest of n random sites: straight borders at every angle."""
    rng = np.random.default_rng(seed)
    sites = rng.uniform(0, [width, height], (n, 2))
    y, x = np.mgrid[:height, :width]
    distance = np.hypot(x[..., None] + 0.5 - sites[:, 0], y[..., None] + 0.5 - sites[:, 1])
    return connected_components(distance.argmin(axis=2).astype(np.int32))


_LABELS = {
    "pixel": lambda: np.zeros((1, 1), np.int32),
    "whole": lambda: np.zeros((13, 300), np.int32),
    "ring": _ring,
    "quadrants": _quadrants,
    "diagonal": _diagonal,
    "stripes": _stripes,
    "voronoi": lambda: voronoi(70, 90, 25, 4),
}
SCENES = tuple(_LABELS)


def labels_of(scene: str) -> np.ndarray:
    """The scene's label map: `(h, w) int32`, regions 0..n-1, each 4-connected."""
    return connected_components(_LABELS[scene]())


@cache
def foundation_of(scene: str) -> Foundation:
    """Curves, domains and S of a scene; every inner border hard."""
    labels = labels_of(scene)
    height, width = labels.shape
    traced = borders(planar_graph(labels), width, height)
    network = fitted_network(traced, traced)
    hard = np.array([not curve.on_frame for curve in network.curves])
    return lay_unfolded_foundation(network, hard)


def no_points() -> np.ndarray:
    return np.zeros((0, 2), np.int64)


def some_points(foundation: Foundation, n: int, seed: int = 0) -> np.ndarray:
    """At most n random pixels that may carry control points, by rows."""
    from gcvec.selection import room

    ys, xs = np.nonzero(room(foundation))
    chosen = np.random.default_rng(seed).permutation(len(xs))[:n]
    points = np.stack([xs, ys], axis=1)[np.sort(chosen)]
    return points.astype(np.int64)


def picture_of(labels: np.ndarray, seed: int = 0) -> np.ndarray:
    """Every region in a colour and a gradient of its own, `(h, w, 3) uint8`."""
    rng = np.random.default_rng(seed)
    n = int(labels.max()) + 1
    color, slope = rng.uniform(40, 215, (n, 3)), rng.uniform(-30, 30, (n, 2, 3))
    y, x = np.mgrid[: labels.shape[0], : labels.shape[1]]
    xy = np.stack([x / labels.shape[1], y / labels.shape[0]], axis=-1) - 0.5
    picture = color[labels] + np.einsum("hwd,hwdc->hwc", xy, slope[labels])
    return np.asarray(np.clip(picture, 0, 255) + 0.5).astype(np.uint8)
