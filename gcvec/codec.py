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

from gcvec import color_coding, entropy, file_limits
from gcvec.boundary import Curve, Network, straight_line
from gcvec.canonical import Canvas, Foundation, lay_canvas, lay_foundation
from gcvec.color_coding import BASIS
from gcvec.color_space import LEFT, RIGHT
from gcvec.curve_coding import CURVE_CONTEXTS, END, HARD, SEGMENTS, START, code_geometry, code_topology
from gcvec.entropy import Coder
from gcvec.errors import InputError
from gcvec.file_limits import control_counts, demand, shortest_stream
from gcvec.loops import network_loops
from gcvec.planar_graph import OUTSIDE
from gcvec.quantization import Quantization
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAGIC = b"GCV"
VERSION = 1

_SIZES, _TEXT, _CURVES = 0, entropy.SEQUENCE_CONTEXTS, 2 * entropy.SEQUENCE_CONTEXTS
_BOUNDARY = _CURVES + CURVE_CONTEXTS
_OCCUPANCY = _BOUNDARY + color_coding.COLOR_CONTEXTS
_COLORS = _OCCUPANCY + entropy.OCCUPANCY_CONTEXTS
_CONTEXTS = _COLORS + color_coding.COLOR_CONTEXTS


def encode(image: VectorImage) -> bytes:
    """The file of a vector image."""
    return encode_rounded(image)[0]


def encode_rounded(image: VectorImage) -> tuple[bytes, Floats, Floats]:
    """The file of a vector image, and its boundary and point colours as a decoder will see them."""
    capacity = (1 << 16) + 4 * len(image.points)
    while True:
        coder = entropy.writer(capacity, _CONTEXTS)
        boundary_colors, point_colors = image.boundary_colors.copy(), image.point_colors.copy()
        n_text, n_points = _write(coder, image, boundary_colors, point_colors)
        stream = entropy.finish(coder)
        if stream is not None:
            stream = stream.ljust(shortest_stream(image.width, image.height, n_points, n_text), b"\0")
            data = MAGIC + bytes([VERSION]) + struct.pack("<I", zlib.crc32(stream)) + stream
            return data, boundary_colors, point_colors
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
        return _read(coder, len(data) - 8)
    except (ValueError, IndexError, RuntimeError, MemoryError, OverflowError) as problem:
        raise InputError(f"the file is damaged: {problem}", code="broken-gcv") from problem


def _write(
    coder: Coder, image: VectorImage, boundary_colors: Floats, point_colors: Floats
) -> tuple[int, int]:
    """Write everything; the colours become what a decoder sees.

    Returns how many bytes of labels, and how many curves and control points.
    """
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
    reference = network.control_points.copy()
    _code_positions(coder, table, steps, reference)
    if image.control_points is not None:
        _code_positions(coder, table, steps, image.control_points.copy())
    _code_boundary(coder, image.foundation, steps, boundary_colors)
    occupied = np.zeros((network.height, network.width), np.uint8)
    occupied[image.points[:, 1], image.points[:, 0]] = 1
    entropy.code_occupancy(coder, _OCCUPANCY, occupied)
    _code_points(coder, image.canvas, steps, image.points, boundary_colors, point_colors)
    return len(text), len(table) + len(reference) + len(image.points)


def _read(coder: Coder, length: int) -> VectorImage:
    """Read everything; `length` is that of the stream, which bounds what may be in it."""
    sizes = np.zeros(9, np.int64)
    entropy.code_sequence(coder, _SIZES, sizes)
    width, height, n_nodes, n_curves, n_patches = (int(n) for n in sizes[:5])
    steps = Quantization(*(int(n) for n in sizes[5:8]))
    edited = bool(sizes[8])
    file_limits.check_sizes(width, height, n_nodes, n_curves, n_patches, length)
    file_limits.check_steps(steps)
    labels = _read_labels(coder, n_patches, length)
    table = np.zeros((n_curves, 7), np.int64)
    code_topology(coder, _CURVES, table)
    file_limits.check_topology(table, n_nodes, n_patches, length)
    reference = _read_positions(coder, table, steps, width, height)
    moved = _read_positions(coder, table, steps, width, height) if edited else None
    network = _network(width, height, n_nodes, n_patches, table, reference)
    hard = table[:, HARD].astype(bool)
    foundation = lay_foundation(network, hard, moved)
    demand(_fills_frame(foundation), "curves that do not fit together")
    boundary_colors = np.zeros((foundation.space.size, 3))
    _code_boundary(coder, foundation, steps, boundary_colors)
    _check_whole(coder)
    occupied = np.zeros((height, width), np.uint8)
    entropy.code_occupancy(coder, _OCCUPANCY, occupied)
    _check_whole(coder)
    ys, xs = np.nonzero(occupied)
    file_limits.check_points(n_curves + len(reference) + len(xs), length)
    points = np.stack([xs, ys], axis=1).astype(np.int64)
    canvas = lay_canvas(foundation, points)
    demand((canvas.mesh.patch >= 0).all() and len(canvas.unit) > 0, "curves that do not fit together")
    point_colors = np.zeros((len(points), 3))
    _code_points(coder, canvas, steps, points, boundary_colors, point_colors)
    _check_whole(coder)
    image = VectorImage(network, hard, boundary_colors, points, point_colors, labels, steps, moved)
    return image.knowing(canvas)


def _check_whole(coder: Coder) -> None:
    demand(entropy.overrun(coder) == 0, "cut short")


def _fills_frame(foundation: Foundation) -> bool:
    """Whether the parameter domains cover every pixel's centre and nothing outside the picture."""
    domain, size = foundation.samples.domain, (foundation.network.width, foundation.network.height)
    mesh = foundation.geometry.mesh
    inside = (domain >= 0).all() and (domain <= size).all()
    return bool(inside and (mesh.patch >= 0).all() and (foundation.geometry.triangle_at >= 0).all())


def _read_labels(coder: Coder, n_patches: int, length: int) -> tuple[str, ...]:
    size = np.zeros(1, np.int64)
    entropy.code_sequence(coder, _SIZES, size)
    file_limits.check_text(int(size[0]), length)
    text = np.zeros(int(size[0]), np.int64)
    entropy.code_sequence(coder, _TEXT, text)
    _check_whole(coder)
    labels = json.loads(text.astype(np.uint8).tobytes().decode())
    demand(isinstance(labels, list) and len(labels) == n_patches, "labels that do not fit the patches")
    return tuple(str(label) for label in labels)


def _read_positions(coder: Coder, table: Ints, steps: Quantization, width: int, height: int) -> Floats:
    control_points = np.zeros((int(control_counts(table).sum()), 2))
    _code_positions(coder, table, steps, control_points)
    _check_whole(coder)
    file_limits.check_places(control_points, width, height)
    return control_points


def _code_positions(coder: Coder, table: Ints, steps: Quantization, control_points: Floats) -> None:
    """Write the control points `(n, 2)` of all curves, or read them.

    Nodes count once; curves on the frame are straight lines between theirs.
    """
    closed = table[:, START] < 0
    on_frame = (table[:, :2] == OUTSIDE).any(axis=1)
    counts = control_counts(table)
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
    parts = np.split(control_points, np.cumsum(control_counts(table))[:-1])
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


def predicted_colors(foundation: Foundation, boundary_colors: Floats, points: Ints) -> Floats:
    """Colours `(n, 3)` that the patches without interior control points have at pixels `points` `(n, 2)`."""
    bare = foundation.bare_canvas
    operator, corner_color = bare.operator(bare.drawing(flatness=np.inf))
    colors: Floats = operator @ boundary_colors
    return foundation.geometry.interpolate(points.astype(np.float64) + 0.5, colors[corner_color])
