"""Made label maps and pictures whose truth is known."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np
import shapely
from scipy.spatial import KDTree

from gcvec import Annotations, Options, Shape, VectorImage, vectorize
from gcvec.borders.border import sample_borders
from gcvec.borders.planar_graph import planar_graph
from gcvec.curves.loops import network_loops
from gcvec.curves.network import Curve, Network, straight_line
from gcvec.curves.network_fit import fitted_network
from gcvec.patches.canonical import Foundation, lay_unfolded_foundation
from gcvec.quantization import Quantization
from gcvec.regions.components import connected_components

FINE = 8
"""Samples a pixel, along each axis, of an anti-aliased picture."""


@dataclass(frozen=True)
class Scene:
    """Regions as a function of the place, `owner(x, y)`, in pixels."""

    height: int
    width: int
    owner: Callable[[np.ndarray, np.ndarray], np.ndarray]

    @property
    def labels(self) -> np.ndarray:
        """Owners at pixel centres, `(h, w) int32`, 4-connected components numbered from 0."""
        y, x = np.mgrid[: self.height, : self.width] + 0.5
        return connected_components(np.asarray(self.owner(x, y), np.int32))

    def picture(self, seed: int = 0) -> np.ndarray:
        """Every owner in a colour and a gradient of its own, anti-aliased: `(h, w, 3) uint8`."""
        return _picture(self, seed).copy()

    def annotations(self) -> Annotations:
        """Every region as a mask, as annotators' brushes make them."""
        shapes = []
        labels = self.labels
        for k in range(int(labels.max()) + 1):
            ys, xs = np.nonzero(labels == k)
            x, y = int(xs.min()), int(ys.min())
            mask = labels[y : ys.max() + 1, x : xs.max() + 1] == k
            shapes.append(Shape(label=f"region {k}", mask=mask, offset=(x, y)))
        return Annotations(shapes=tuple(shapes))


@lru_cache(maxsize=32)
def _picture(scene: Scene, seed: int) -> np.ndarray:
    """Many tests begin with the same few pictures."""
    y, x = (np.mgrid[: scene.height * FINE, : scene.width * FINE] + 0.5) / FINE
    owner = np.asarray(scene.owner(x, y))
    rng = np.random.default_rng(seed)
    n = int(owner.max()) + 1
    color, slope = rng.uniform(40, 215, (n, 3)), rng.uniform(-30, 30, (n, 2, 3))
    xy = np.stack([x / scene.width, y / scene.height], axis=-1) - 0.5
    fine = color[owner] + (xy[..., None] * slope[owner]).sum(axis=2)
    blocks = fine.reshape(scene.height, FINE, scene.width, FINE, 3).mean(axis=(1, 3))
    return np.asarray(np.clip(blocks, 0, 255) + 0.5).astype(np.uint8)


def drawn(labels: np.ndarray) -> Scene:
    """The scene with borders along pixels, as in a label map."""
    height, width = labels.shape
    return Scene(height, width, lambda x, y: labels[y.astype(int), x.astype(int)])


def _ring(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    outer, inner = np.hypot(x - 112, y - 98) < 90, np.hypot(x - 120, y - 90) < 20
    return outer.astype(int) + (outer & inner)


def _quadrants(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return (x >= 82).astype(int) + 2 * (y >= 70)


def _nested(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Rings within rings, from ten pixels wide to one."""
    radii = np.array([4.0, 5.1, 7.2, 10.0, 14.0, 20.0, 30.0])
    return np.asarray(np.searchsorted(radii, np.hypot(x - 34.3, y - 32.8)))


def _needles(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Two needles that end in points, one of which pierces the frame, and a wedge between two regions."""
    long = (np.abs(y - 14 - 0.1 * x) < 3 * (1 - x / 62)).astype(int)
    short = np.abs(x - 52.3) < 2.4 * np.clip((y - 26) / 22, 0, 1) * (y < 48)
    wedge = (y > 36) & (x < 40) & (np.abs(y - 46) < (40 - x) / 8)
    lower = (y > 46) & (x < 46)
    return np.asarray(np.select([wedge, short, long > 0, lower], [4, 2, 1, 3], 0))


def _wheel(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Eight slices that meet in one point and reach the frame."""
    angle = np.arctan2(y - 29.6, x - 31.2) + 0.3
    return np.asarray((angle % (2 * np.pi) / (np.pi / 4)).astype(int))


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


def voronoi(height: int, width: int, n: int, seed: int) -> Scene:
    """Nearest of n random sites: straight borders at every angle."""
    sites = KDTree(np.random.default_rng(seed).uniform(0, [width, height], (n, 2)))
    return Scene(height, width, lambda x, y: sites.query(np.stack([x, y], axis=-1))[1])


SCENES = {
    "pixel": drawn(np.zeros((1, 1), np.int32)),
    "whole": drawn(np.zeros((13, 300), np.int32)),
    "ring": Scene(200, 220, _ring),
    "quadrants": Scene(150, 170, _quadrants),
    "diagonal": drawn(_diagonal()),
    "stripes": drawn(_stripes()),
    "voronoi": voronoi(70, 90, 25, 4),
    "nested": Scene(66, 70, _nested),
    "needles": Scene(60, 64, _needles),
    "wheel": Scene(58, 62, _wheel),
}


@cache
def vectorized(scene: str, target_mse: float = 5.0) -> VectorImage:
    made = SCENES[scene]
    return vectorize(made.picture(), made.annotations(), Options(target_mse=target_mse))


@cache
def foundation_of(scene: str, hard: bool = True) -> Foundation:
    """Curves, domains and S of a scene; every inner border hard, or soft."""
    labels = SCENES[scene].labels
    height, width = labels.shape
    traced = sample_borders(planar_graph(labels), width, height)
    network = fitted_network(traced, traced, Quantization().grid)
    return lay_unfolded_foundation(network, np.array([hard and not c.on_frame for c in network.curves]))


def needle() -> Foundation:
    """Left and right of a patch, the last one, that is so thin that it holds the centre of no pixel."""
    corners = np.array([(0, 0), (20.6, 0), (20.8, 0), (40, 0), (40, 20), (20.8, 20), (20.6, 20), (0, 20)])
    around = [(-1, patch, node, (node + 1) % 8) for node, patch in enumerate([0, 2, 1, 1, 1, 2, 0, 0])]
    across = [(2, 0, 1, 6), (1, 2, 2, 5)]
    curves = tuple(
        Curve(straight_line(corners[start], corners[end], 1), left, right, start, end)
        for left, right, start, end in around + across
    )
    network = Network(40, 20, len(corners), curves, network_loops(curves, 3))
    return lay_unfolded_foundation(network, np.arange(len(curves)) >= len(around))


def no_points() -> np.ndarray:
    return np.zeros((0, 2), np.int64)


def clear_of_edges(foundation: Foundation, distance: float) -> np.ndarray:
    """Pixels `(h, w) bool` whose centres are at least so far from every polygon edge."""
    network, samples = foundation.network, foundation.samples
    y, x = np.mgrid[: network.height, : network.width] + 0.5
    edges = shapely.STRtree(shapely.linestrings(samples.domain[samples.edge_ends]))
    near, _ = edges.query(shapely.points(x.ravel(), y.ravel()), predicate="dwithin", distance=distance)
    clear = np.ones(x.size, bool)
    clear[near] = False
    return clear.reshape(x.shape)


def some_points(foundation: Foundation, n: int, seed: int = 0) -> np.ndarray:
    """At most n random pixels well inside patches, by rows."""
    ys, xs = np.nonzero(clear_of_edges(foundation, 0.6))
    chosen = np.random.default_rng(seed).permutation(len(xs))[:n]
    return np.stack([xs, ys], axis=1)[np.sort(chosen)].astype(np.int64)


def noise(height: int = 40, width: int = 50) -> np.ndarray:
    """A picture that few points cannot follow, `(h, w, 3) uint8`."""
    return np.random.default_rng(0).integers(0, 256, (height, width, 3)).astype(np.uint8)
