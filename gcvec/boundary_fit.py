"""Borders → the network of curves that the file will hold: on its grid, and crossing nowhere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.borders import Borders, between_nodes
from gcvec.boundary import DISTANCE, Network, boundary_network
from gcvec.domain import FINEST_LEVEL, crossing_curves, with_levels, without_crossings
from gcvec.quantization import Quantization, rounded_network

GRID = Quantization().grid

FALLBACKS = (DISTANCE, DISTANCE, DISTANCE / 2, DISTANCE / 4, 0.0)
"""Distances allowed to a curve, try after try; from the second on it follows the label map, not the photo."""


def fitted_network(traced: Borders, localized: Borders, grid: float = GRID) -> Network:
    """Curves through the localized borders, on a grid of `grid` pixels, with the levels of their parameter
    polygons.

    Curves that cross themselves or others, as they may around regions a pixel or two wide, go back to the
    border as it
    was traced and follow it ever more closely.
    """
    tries = np.zeros(len(traced.borders), np.int64)
    while True:
        network = rounded_network(
            boundary_network(_mixed(traced, localized, tries), [FALLBACKS[k] for k in tries]), grid
        )
        crossing = crossing_curves(with_levels(network, FINEST_LEVEL))
        pending = crossing[tries[crossing] < len(FALLBACKS) - 1]
        if not len(pending):
            return without_crossings(network)
        tries[pending] += 1


def _mixed(traced: Borders, localized: Borders, tries: NDArray[np.int64]) -> Borders:
    """Localized borders, but traced ones, nodes included, where the first try failed."""
    nodes = localized.nodes.copy()
    chosen = list(localized.borders)
    for k in np.flatnonzero(tries):
        chosen[k] = traced.borders[k]
        if not chosen[k].closed:
            ends = [chosen[k].start, chosen[k].end]
            nodes[ends] = traced.nodes[ends]
    fitted = tuple(between_nodes(border, nodes) for border in chosen)
    return Borders(traced.width, traced.height, nodes, fitted, traced.loops)
