"""The `.gcv` file (paper, section 5.1): everything in steps, entropy coded.

The letters GCV, a version byte, the CRC-32 of what follows, and one range-coded stream: sizes and steps, the
curves' topology and control points, boundary colours, a bitmap of interior control points, and their colours
as residuals against what their surroundings predict. `docs/format.md` describes it for other implementations.
"""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import astuple

import numpy as np
from numpy.typing import NDArray

from gcvec import color_coding, entropy
from gcvec.boundary import Curve, Network, straight_line
from gcvec.canonical import Canvas, Foundation, lay_canvas, lay_foundation
from gcvec.color_coding import BASIS
from gcvec.color_space import LEFT, RIGHT
from gcvec.curve_coding import (
    CURVE_CONTEXTS,
    END,
    HARD,
    LEVEL,
    SEGMENTS,
    START,
    code_geometry,
    code_topology,
)
from gcvec.domain import FINEST_LEVEL
from gcvec.entropy import Coder
from gcvec.errors import InputError
from gcvec.loops import network_loops
from gcvec.planar_graph import OUTSIDE
from gcvec.quantization import Quantization
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAGIC = b"GCV"
VERSION = 1

MOST_PIXELS = 1 << 26
MOST_CURVES = 1 << 20
MOST_CONTROL_POINTS = 1 << 24
MOST_LABEL_BYTES = 1 << 24
"""What a file may claim; a reader allocates no more than these allow."""

_SIZES, _TEXT, _CURVES = 0, entropy.SEQUENCE_CONTEXTS, 2 * entropy.SEQUENCE_CONTEXTS
_BOUNDARY = _CURVES + CURVE_CONTEXTS
_OCCUPANCY = _BOUNDARY + color_coding.COLOR_CONTEXTS
_COLORS = _OCCUPANCY + entropy.OCCUPANCY_CONTEXTS
_CONTEXTS = _COLORS + color_coding.COLOR_CONTEXTS


def encode(image: VectorImage) -> bytes:
    """The file of a vector image."""
    capacity = 1 << 16
    while True:
        coder = entropy.writer(capacity, _CONTEXTS)
        _write(coder, image)
        stream = entropy.finish(coder)
        if stream is not None:
            return MAGIC + bytes([VERSION]) + struct.pack("<I", zlib.crc32(stream)) + stream
        capacity *= 4


def decode(data: bytes) -> VectorImage:
    """The vector image of a file; `InputError` when the file is not whole."""
    if data[:3] != MAGIC:
        raise InputError("not a gcvec file", code="broken-gcv")
    if len(data) < 8 or data[3] != VERSION:
        raise InputError("a gcvec file of a version this program does not know", code="broken-gcv")
    if zlib.crc32(data[8:]) != struct.unpack("<I", data[4:8])[0]:
        raise InputError("the file is damaged or cut short", code="broken-gcv")
    coder = entropy.reader(data[8:], _CONTEXTS)
    try:
        return _read(coder)
    except (ValueError, IndexError, RuntimeError, MemoryError, OverflowError) as problem:
        raise InputError(f"the file is damaged: {problem}", code="broken-gcv") from problem


def _write(coder: Coder, image: VectorImage) -> None:
    network, steps = image.network, image.quantization
    sizes = [network.width, network.height, network.n_nodes, len(network.curves), len(network.loops)]
    entropy.code_sequence(
        coder, _SIZES, np.array([*sizes, *astuple(steps), image.control_points is not None])
    )
    text = np.frombuffer(json.dumps(image.labels, ensure_ascii=False).encode(), np.uint8).astype(np.int64)
    entropy.code_sequence(coder, _SIZES, np.array([len(text)]))
    entropy.code_sequence(coder, _TEXT, text)
    table = np.array(
        [
            (c.left, c.right, c.start, c.end, c.level, c.segments, h)
            for c, h in zip(network.curves, image.hard, strict=True)
        ]
    )
    code_topology(coder, _CURVES, table)
    reference = np.concatenate([c.control_points for c in network.curves])
    _code_positions(coder, table, steps, reference)
    if image.control_points is not None:
        _code_positions(coder, table, steps, image.control_points)
    colors = image.boundary_colors.copy()
    _code_boundary(coder, image.foundation, steps, colors)
    occupied = np.zeros((network.height, network.width), np.uint8)
    occupied[image.points[:, 1], image.points[:, 0]] = 1
    entropy.code_occupancy(coder, _OCCUPANCY, occupied)
    _code_points(coder, image.canvas, steps, image.points, colors, image.point_colors.copy())


def _read(coder: Coder) -> VectorImage:
    sizes = np.zeros(9, np.int64)
    entropy.code_sequence(coder, _SIZES, sizes)
    width, height, n_nodes, n_curves, n_patches = (int(n) for n in sizes[:5])
    steps = Quantization(*(int(n) for n in sizes[5:8]))
    edited = bool(sizes[8])
    _demand(width > 0 and height > 0 and width * height <= MOST_PIXELS, "impossible size")
    _demand(
        0 < n_curves <= MOST_CURVES and 0 <= n_nodes <= 2 * n_curves and 0 < n_patches <= n_curves,
        "impossible counts",
    )
    _demand(
        0 <= steps.position_bits <= 12 and min(steps.boundary_step, steps.point_step) > 0, "impossible steps"
    )
    labels = _read_labels(coder, n_patches)
    table = np.zeros((n_curves, 7), np.int64)
    code_topology(coder, _CURVES, table)
    _check_topology(table, n_nodes, n_patches)
    _demand(entropy.overrun(coder) == 0, "cut short")
    reference = np.zeros((int(_control_counts(table).sum()), 2))
    _code_positions(coder, table, steps, reference)
    moved = np.zeros_like(reference) if edited else None
    if moved is not None:
        _code_positions(coder, table, steps, moved)
    network = _network(width, height, n_nodes, n_patches, table, reference)
    hard = table[:, HARD].astype(bool)
    foundation = lay_foundation(network, hard, moved)
    boundary_colors = np.zeros((foundation.space.size, 3))
    _code_boundary(coder, foundation, steps, boundary_colors)
    _demand(entropy.overrun(coder) == 0, "cut short")
    occupied = np.zeros((height, width), np.uint8)
    entropy.code_occupancy(coder, _OCCUPANCY, occupied)
    ys, xs = np.nonzero(occupied)
    points = np.stack([xs, ys], axis=1).astype(np.int64)
    canvas = lay_canvas(foundation, points)
    _demand(bool((canvas.mesh.patch >= 0).all()) and len(canvas.unit) > 0, "curves that do not fit together")
    point_colors = np.zeros((len(points), 3))
    _code_points(coder, canvas, steps, points, boundary_colors, point_colors)
    _demand(entropy.overrun(coder) == 0, "cut short")
    image = VectorImage(network, hard, boundary_colors, points, point_colors, labels, steps, moved)
    image.__dict__.update(foundation=foundation, canvas=canvas)
    return image


def _demand(condition: bool, what: str) -> None:
    if not condition:
        raise ValueError(what)


def _read_labels(coder: Coder, n_patches: int) -> tuple[str, ...]:
    size = np.zeros(1, np.int64)
    entropy.code_sequence(coder, _SIZES, size)
    _demand(0 <= size[0] <= MOST_LABEL_BYTES, "impossible labels")
    text = np.zeros(int(size[0]), np.int64)
    entropy.code_sequence(coder, _TEXT, text)
    _demand(entropy.overrun(coder) == 0, "cut short")
    labels = json.loads(text.astype(np.uint8).tobytes().decode())
    _demand(isinstance(labels, list) and len(labels) == n_patches, "labels that do not fit the patches")
    return tuple(str(label) for label in labels)


def _check_topology(table: Ints, n_nodes: int, n_patches: int) -> None:
    sides = table[:, :2]
    _demand(bool(((sides >= OUTSIDE) & (sides < n_patches)).all()), "a curve beside an unknown patch")
    _demand(bool((sides[:, 0] != sides[:, 1]).all()), "a curve with the same patch on both sides")
    ends = table[:, [START, END]]
    closed = ends[:, 0] < 0
    _demand(bool(((ends >= -1) & (ends < n_nodes)).all()), "a curve at an unknown node")
    _demand(bool((closed == (ends[:, 1] < 0)).all()), "a curve with one end")
    _demand(len(np.unique(ends[~closed])) == n_nodes, "a node without curves")
    _demand(bool(((table[:, LEVEL] >= 0) & (table[:, LEVEL] <= FINEST_LEVEL)).all()), "an impossible level")
    fewest = np.where(closed, 3, 1)
    _demand(bool((table[:, SEGMENTS] >= fewest).all()), "a curve without segments")
    _demand(int(_control_counts(table).sum()) <= MOST_CONTROL_POINTS, "too many control points")


def _control_counts(table: Ints) -> Ints:
    return np.asarray(table[:, SEGMENTS] + np.where(table[:, START] < 0, 0, 3))


def _code_positions(coder: Coder, table: Ints, steps: Quantization, control_points: Floats) -> None:
    """Write the control points `(n, 2)` of all curves, or read them.

    Nodes count once; curves on the frame are straight lines between theirs.
    """
    closed = table[:, START] < 0
    on_frame = (table[:, :2] == OUTSIDE).any(axis=1)
    counts = _control_counts(table)
    first = np.cumsum(counts) - counts
    inner_counts = np.where(on_frame & ~closed, 0, np.where(closed, counts, counts - 2))
    offsets = np.concatenate([[0], np.cumsum(inner_counts)])
    inner = np.arange(offsets[-1]) + np.repeat(first + ~closed - offsets[:-1], inner_counts)
    open_curves = np.flatnonzero(~closed)
    ends = np.concatenate([first[open_curves], first[open_curves] + counts[open_curves] - 1])
    at = np.concatenate([table[open_curves, START], table[open_curves, END]])
    nodes = np.zeros((int(at.max(initial=-1)) + 1, 2), np.int64)
    grid = np.round(control_points / steps.grid).astype(np.int64)
    nodes[at] = grid[ends]
    places = grid[inner]
    code_geometry(coder, _CURVES, table, offsets, nodes, places)
    control_points[inner] = places * steps.grid
    control_points[ends] = nodes[at] * steps.grid
    for c in np.flatnonzero(on_frame & ~closed):
        own = slice(first[c], first[c] + counts[c])
        control_points[own] = straight_line(
            control_points[own][0], control_points[own][-1], int(table[c, SEGMENTS])
        )


def _network(
    width: int, height: int, n_nodes: int, n_patches: int, table: Ints, control_points: Floats
) -> Network:
    parts = np.split(control_points, np.cumsum(_control_counts(table))[:-1])
    curves = tuple(
        Curve(part, *(int(n) for n in row[: HARD - 1])) for part, row in zip(parts, table, strict=True)
    )
    return Network(width, height, n_nodes, curves, network_loops(curves, n_patches))


def _code_boundary(coder: Coder, foundation: Foundation, steps: Quantization, colors: Floats) -> None:
    """Write the boundary colours, or read them; either way `colors` becomes what a decoder sees."""
    offsets, unknown = foundation.samples.offsets, foundation.space.of_control
    sides = [
        (unknown[side, offsets[c] : offsets[c + 1]], patch)
        for c, curve in enumerate(foundation.network.curves)
        for side, patch in ((RIGHT, curve.right), (LEFT, curve.left))
        if patch != OUTSIDE
    ]
    starts = np.concatenate([[0], np.cumsum([len(u) for u, _ in sides])])
    color_coding.code_boundary_colors(
        coder,
        _BOUNDARY,
        np.concatenate([u for u, _ in sides]),
        starts,
        np.array([patch for _, patch in sides]),
        len(foundation.network.loops),
        colors,
        steps.boundary,
        BASIS,
    )


def _code_points(
    coder: Coder, canvas: Canvas, steps: Quantization, points: Ints, boundary_colors: Floats, colors: Floats
) -> None:
    """Write the interior colours, or read them; either way `colors` becomes what a decoder sees."""
    network = canvas.foundation.network
    color_coding.code_point_colors(
        coder,
        _COLORS,
        color_coding.progressive_order(points),
        points,
        canvas.patch_of_points(),
        predicted_colors(canvas.foundation, boundary_colors, points),
        colors,
        network.width,
        network.height,
        steps.point,
        BASIS,
    )


def quantized_boundary(foundation: Foundation, steps: Quantization, colors: Floats) -> Floats:
    """Boundary colours `(b, 3)` as a decoder will see them."""
    seen = colors.copy()
    _code_boundary(entropy.writer(0, _CONTEXTS), foundation, steps, seen)
    return seen


def predicted_colors(foundation: Foundation, boundary_colors: Floats, points: Ints) -> Floats:
    """Colours `(n, 3)` that the patches without interior control points have at pixels `points` `(n, 2)`."""
    bare = foundation.bare_canvas
    operator, corner_color = bare.operator(bare.drawing(flatness=np.inf))
    colors: Floats = operator @ boundary_colors
    return foundation.geometry.interpolate(points.astype(np.float64) + 0.5, colors[corner_color])
