"""What a `.gcv` file may claim: bounds on sizes and counts, most of them by the file's own length.

An adaptive coder packs a million decisions into a few bytes, so the length of a file alone bounds nothing.
These rules, which are part of the format, do: a reader checks each before it allocates or loops, and needs
time and memory in proportion to the file. A writer appends zero bytes where a file would be too short for
what it holds. Every check raises `ValueError`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import MOST_AT_NODE, OUTSIDE
from gcvec.codec.topology import END, LEFT_PATCH, LEVEL, RIGHT_PATCH, SEGMENTS, START
from gcvec.curves.domain import FINEST_LEVEL
from gcvec.photo import MOST_PIXELS
from gcvec.quantization import Quantization

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

PIXELS_A_BYTE = 4096
"""Pixels that one byte of a stream allows; few pictures are so empty that it takes padding."""

POINTS_A_BYTE = 2
TEXT_A_BYTE = 64
"""Curves and control points of all kinds together, and bytes of labels, that one byte of a stream allows."""


def shortest_stream(width: int, height: int, n_points: int, n_text: int) -> int:
    """Bytes that the stream must have; `n_points` counts curves and control points of all kinds."""
    return max(-(-width * height // PIXELS_A_BYTE), -(-n_points // POINTS_A_BYTE), -(-n_text // TEXT_A_BYTE))


def demand(condition: object, what: str) -> None:
    """`ValueError` that says `what` is wrong unless the condition holds."""
    if not condition:
        raise ValueError(what)


def check_sizes(width: int, height: int, n_nodes: int, n_curves: int, n_patches: int, stream: int) -> None:
    """Sizes and counts of a file whose stream has `stream` bytes."""
    demand(0 < width <= MOST_PIXELS and 0 < height <= MOST_PIXELS, "impossible size")
    demand(width * height <= min(MOST_PIXELS, PIXELS_A_BYTE * stream), "impossible size")
    demand(0 < n_curves <= POINTS_A_BYTE * stream, "impossible counts")
    demand(0 <= n_nodes <= 2 * n_curves and 0 < n_patches <= n_curves, "impossible counts")


def check_steps(steps: Quantization) -> None:
    demand(
        0 <= steps.position_bits <= 12 and min(steps.boundary_step, steps.point_step) > 0, "impossible steps"
    )


def check_text(n_bytes: int, stream: int) -> None:
    demand(0 <= n_bytes <= TEXT_A_BYTE * stream, "impossible labels")


def check_topology(table: Ints, n_nodes: int, n_patches: int, stream: int) -> None:
    """The table of curves `(c, 7)`."""
    sides = table[:, [LEFT_PATCH, RIGHT_PATCH]]
    demand(((sides >= OUTSIDE) & (sides < n_patches)).all(), "a curve beside an unknown patch")
    demand((sides[:, 0] != sides[:, 1]).all(), "a curve with the same patch on both sides")
    ends = table[:, [START, END]]
    closed = ends[:, 0] < 0
    demand(((ends >= -1) & (ends < n_nodes)).all(), "a curve at an unknown node")
    demand((closed == (ends[:, 1] < 0)).all(), "a curve with one end")
    meeting = np.bincount(ends[~closed].ravel(), minlength=n_nodes)
    demand((meeting > 0).all(), "a node without curves")
    demand((meeting <= MOST_AT_NODE).all(), "too many curves at a node")
    demand(((table[:, LEVEL] >= 0) & (table[:, LEVEL] <= FINEST_LEVEL)).all(), "an impossible level")
    demand((table[:, SEGMENTS] >= np.where(closed, 3, 1)).all(), "a curve without segments")
    check_points(len(table) + int(control_counts(table).sum()), stream)


def check_points(n_points: int, stream: int) -> None:
    """Curves and control points, so many so far."""
    demand(n_points <= POINTS_A_BYTE * stream, "too many control points")


def check_places(control_points: Floats, width: int, height: int) -> None:
    """Control points `(n, 2)` of curves: no further from the picture than its width and height together."""
    demand(not too_far(control_points, width, height).any(), "a control point far from the picture")


def too_far(control_points: Floats, width: int, height: int) -> NDArray[np.bool_]:
    """Which control points `(n, 2)` are further from the picture than a file allows, `(n,)`."""
    past = np.maximum(-control_points, control_points - [width, height])
    return np.asarray((past > width + height).any(axis=1))


def control_counts(table: Ints) -> Ints:
    """Control points `(c,)` of each curve of a table."""
    return np.asarray(table[:, SEGMENTS] + np.where(table[:, START] < 0, 0, 3))
