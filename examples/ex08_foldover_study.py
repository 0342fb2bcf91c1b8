"""How often patches fold over, by the shape of the domain: over 1,000 regions of photos (paper, section 4.1).

Every region has its own curves. They are spanned over a regular polygon, over a coarse polygon that follows
the region to within four pixels, and over the polygons that vectorization gives it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray
from skimage import data

from examples import figures
from examples.coons import Curve, Patch, generalized_coons, polyline, regular_polygon
from gcvec.borders.border import sample_borders
from gcvec.borders.planar_graph import planar_graph
from gcvec.curves import bspline
from gcvec.curves.network import Network
from gcvec.curves.network_fit import fitted_network
from gcvec.patches.canonical import lay_unfolded_foundation
from gcvec.patches.drawing import folded
from gcvec.quantization import Quantization
from gcvec.regions.segment import segment

Floats = NDArray[np.float64]

PHOTOS: tuple[Callable[[], Any], ...] = (data.coffee, data.astronaut, data.chelsea, data.rocket)
REGIONS = 300
"""Regions wanted of each photo."""

COARSE = 4.0
"""Distance between a region and its coarse polygon, pixels."""

FINENESS = 16


@dataclass(frozen=True)
class Outline:
    """The boundary `(n, 2)` of a region without holes, and which samples are vertices of its polygon."""

    samples: Floats
    vertices: NDArray[np.int64]

    @property
    def polygon(self) -> Floats:
        return self.samples[self.vertices]

    def curves(self) -> list[Curve]:
        """The stretches between consecutive vertices."""
        around = np.concatenate([self.samples, self.samples])
        ends = np.append(self.vertices[1:], self.vertices[0] + len(self.samples))
        return [polyline(around[a : b + 1]) for a, b in zip(self.vertices, ends, strict=True)]


def main() -> dict[str, float]:
    """Number of regions, and the share of them in which each kind of domain folds over."""
    counts = {"regular": 0, "coarse": 0, "default": 0}
    regions = 0
    worst: tuple[int, Patch, Patch] | None = None
    for photo in PHOTOS:
        network, of_default = _network(photo())
        for region in range(len(network.loops)):
            outline = _outline(network, region)
            if outline is None:
                continue
            regions += 1
            curves = outline.curves()
            regular = generalized_coons(regular_polygon(len(curves)), curves, FINENESS)
            coarse = generalized_coons(outline.polygon, curves, FINENESS)
            counts["regular"] += bool(regular.flipped.any())
            counts["coarse"] += bool(coarse.flipped.any())
            counts["default"] += region in of_default
            turned = int(regular.flipped.sum())
            if not coarse.flipped.any() and (worst is None or turned > worst[0]):
                worst = turned, regular, coarse
    assert worst is not None
    figures.save("foldover_study", [figures.mesh_panels(worst[1]), figures.mesh_panels(worst[2])], step=4)
    return {"regions": regions, **{name: count / regions for name, count in counts.items()}}


def _network(pixels: NDArray[np.uint8]) -> tuple[Network, set[int]]:
    """The curves of a photo's automatic regions, and the regions whose patches fold over."""
    height, width = pixels.shape[:2]
    traced = sample_borders(planar_graph(segment(pixels, REGIONS).labels), width, height)
    network = fitted_network(traced, traced, Quantization().grid)
    foundation = lay_unfolded_foundation(network, np.zeros(len(network.curves), bool))
    mesh = foundation.geometry.mesh
    turned = mesh.patch[folded(foundation.geometry.image, mesh.triangles)]
    return foundation.network, set(turned.tolist())


def _outline(network: Network, region: int) -> Outline | None:
    if len(network.loops[region]) > 1:
        return None
    pieces = []
    for c, forward in network.loops[region][0]:
        curve = network.curves[c]
        u = np.arange(4 * curve.segments) / 4
        u = u if forward else curve.segments - u
        pieces.append(bspline.evaluate(curve.control_points, u, curve.closed))
    samples = np.concatenate(pieces)
    simple = shapely.simplify(shapely.Polygon(samples), COARSE, preserve_topology=True)
    kept = shapely.get_coordinates(simple.exterior)[:-1]
    vertices = np.flatnonzero((samples[:, None] == kept).all(axis=2).any(axis=1))
    return Outline(samples, vertices) if len(vertices) == len(kept) >= 3 else None


if __name__ == "__main__":
    print(main())
