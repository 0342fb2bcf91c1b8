"""Where interior control points can be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.kernels import kernel
from gcvec.patches.canonical import Foundation

CLEARANCE = 0.15
"""Control points keep this far from the edges of their parameter polygon, pixels."""


def find_clear_pixels(foundation: Foundation) -> NDArray[np.bool_]:
    """Pixels `(h, w)` whose centres keep their distance from every polygon edge."""
    network, samples = foundation.network, foundation.samples
    ends = samples.domain[samples.edge_ends]
    return np.asarray(_clear_of(ends, network.width, network.height))


@kernel
def _clear_of(edges, width, height):
    clear = np.ones((height, width), np.bool_)
    for e in range(len(edges)):
        ax, ay, bx, by = edges[e, 0, 0], edges[e, 0, 1], edges[e, 1, 0], edges[e, 1, 1]
        dx, dy = bx - ax, by - ay
        square = max(dx * dx + dy * dy, 1e-12)
        steps = int(max(abs(dx), abs(dy))) + 1
        for i in range(steps + 1):
            mx, my = int(ax + dx * i / steps), int(ay + dy * i / steps)
            for y in range(max(my - 2, 0), min(my + 3, height)):
                for x in range(max(mx - 2, 0), min(mx + 3, width)):
                    px, py = x + 0.5 - ax, y + 0.5 - ay
                    t = min(max((px * dx + py * dy) / square, 0.0), 1.0)
                    if np.hypot(px - t * dx, py - t * dy) < CLEARANCE:
                        clear[y, x] = False
    return clear
