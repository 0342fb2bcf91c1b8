"""A foundation to divide, a part of it to refine, and what comes of that."""

from __future__ import annotations

from functools import cache

import numpy as np

from gcvec.borders.border import sample_borders
from gcvec.borders.planar_graph import planar_graph
from gcvec.curves.network_fit import fitted_network
from gcvec.parts.division import part_of
from gcvec.parts.messages import PartRequest, PartResult
from gcvec.parts.part import refine_part
from gcvec.patches.canonical import Foundation, lay_unfolded_foundation
from gcvec.quantization import Quantization
from tests.gcvec.scenes import voronoi


@cache
def wide() -> Foundation:
    """Larger than a cell, so that parts begin elsewhere than the picture; some borders soft."""
    made = voronoi(300, 700, 14, 3)
    traced = sample_borders(planar_graph(made.labels), made.width, made.height)
    network = fitted_network(traced, traced, Quantization().grid)
    hard = np.array([not curve.on_frame and c % 3 > 0 for c, curve in enumerate(network.curves)])
    return lay_unfolded_foundation(network, hard)


@cache
def a_request() -> PartRequest:
    part = part_of(wide(), [2, 3, 7])
    return PartRequest(
        number=5,
        rounds=0,
        network=part.network,
        hard=part.hard,
        prior=np.full((len(part.colors), 3), 0.25),
        points=np.zeros((0, 2), np.int64),
        colors=np.full((len(part.colors), 3), 0.5),
        target_mse=5.0,
        axes=3,
        goal=12.5,
        shares=(0.0, 0.2),
        max_points=300,
        bias=1.25,
        shared=np.array([3, 4], np.int64),
        wanted=np.full((2, 3), 0.125, np.float32),
    )


@cache
def a_result() -> PartResult:
    pixels = np.random.default_rng(0).integers(0, 256, (300, 700, 3)).astype(np.uint8)
    return refine_part(a_request(), pixels, lambda _: None)
