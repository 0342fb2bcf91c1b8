"""The `.gcv` file (paper, section 5.1): everything in steps, entropy coded.

The letters GCV, a version byte, the CRC-32 of what follows, and one range-coded stream: sizes and steps, the
curves' topology and control points, boundary colours, a bitmap of interior control points, and their colours
as residuals against what their surroundings predict. `docs/format.md` describes it for other implementations.
"""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import astuple, replace

import numpy as np
from numpy.typing import NDArray

from gcvec.borders.planar_graph import OUTSIDE
from gcvec.codec import limits, range_coder
from gcvec.codec.blending import ALONG
from gcvec.codec.boundary_colors import (
    BOUNDARY_COUNTERS,
    BOUNDARY_INPUTS,
    BOUNDARY_ROWS,
    code_boundary_colors,
)
from gcvec.codec.colors import FRACTION, from_coordinates, to_coordinates
from gcvec.codec.echo import echo_of, silence
from gcvec.codec.former import FORMER_NEIGHBORS, NOT_ALONG, even_strides, former_crowds
from gcvec.codec.geometry import GEOMETRY_COUNTERS, GEOMETRY_INPUTS, GEOMETRY_ROWS, code_geometry
from gcvec.codec.integers import LONGEST, SEQUENCE_COUNTERS, SEQUENCE_INPUTS, SEQUENCE_ROWS, code_sequence
from gcvec.codec.limits import control_counts, demand, shortest_stream
from gcvec.codec.mixing import Model, fresh_model
from gcvec.codec.neighborhoods import neighborhoods
from gcvec.codec.occupancy import OCCUPANCY_COUNTERS, OCCUPANCY_INPUTS, OCCUPANCY_ROWS, code_occupancy
from gcvec.codec.point_colors import (
    POINT_COUNTERS,
    POINT_INPUTS,
    POINT_ROWS,
    code_point_colors,
)
from gcvec.codec.range_coder import Coder
from gcvec.codec.strides import COARSEST_STRIDE, FIRST_STRIDE, crowds_by_stride
from gcvec.codec.text import TEXT_COUNTERS, TEXT_INPUTS, TEXT_ROWS, code_text
from gcvec.codec.topology import (
    END,
    HARD,
    SEGMENTS,
    START,
    TOPOLOGY_COUNTERS,
    TOPOLOGY_INPUTS,
    TOPOLOGY_ROWS,
    code_topology,
)
from gcvec.colors.color_fit import ColorFit
from gcvec.curves.loops import network_loops
from gcvec.curves.network import Curve, Network, straight_line
from gcvec.errors import InputError
from gcvec.patches.canonical import Foundation, lay_canvas, lay_foundation
from gcvec.patches.color_space import LEFT, RIGHT
from gcvec.plain_text import plain_text
from gcvec.quantization import Quantization
from gcvec.recoloring import FULL_SHIFT, recolored
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

GRAY = 0.5
"""The colour that boundary colours are differences from."""

MAGIC = b"GCV"
VERSION = 7
READABLE = 2, 3, 4, 5, 6, VERSION
"""Older files hold the same; before 5 they were drawn a little differently."""

FIRST_RECOLORED, FIRST_BLENDED, FIRST_WEIGHED = 4, 6, 7
"""The first versions whose files may hold recolours, blend predictions of interior colours, and store colours
the coarser the less of the picture is theirs."""

STEP_UNITS = {2: 16, 3: 16, 4: 16, 5: 4, 6: 4, VERSION: 1}
"""What a step of colours counts in, by version, in the smallest units."""

MOVED, RECOLORED = 1, 2
"""Edits of a picture, as the header names them."""


def encode(image: VectorImage) -> bytes:
    """The file of a vector image."""
    return encode_rounded(image)[0]


def encode_rounded(image: VectorImage, fit: ColorFit | None = None) -> tuple[bytes, Floats, Floats]:
    """The file of a vector image, and its boundary and point colours as a decoder will see them: those of
    before where patches were recoloured.

    Colours are rounded so that they make up for each other in the picture they are a `fit` to, if it is
    given.
    """
    recoloring = image.recoloring
    if recoloring:
        image = recoloring.original
    capacity = (1 << 16) + 4 * len(image.points)
    while True:
        coder = range_coder.writer(capacity)
        boundary_colors, point_colors = image.boundary_colors.copy(), image.point_colors.copy()
        n_text, n_points = _write(
            coder, image, boundary_colors, point_colors, recoloring.shifts if recoloring else None, fit
        )
        stream = range_coder.finish(coder)
        if stream is not None:
            stream = stream.ljust(shortest_stream(image.width, image.height, n_points, n_text), b"\0")
            return sealed(stream), boundary_colors, point_colors
        capacity *= 4


def rounded_colors(image: VectorImage, fit: ColorFit | None = None) -> tuple[Floats, Floats]:
    """The boundary and point colours that a decoder of a vector image's file will see: see `encode_rounded`.
    Of one without recoloured patches; the file is not made."""
    coder, steps = range_coder.rehearser(), image.quantization
    boundary_colors, point_colors = image.boundary_colors.copy(), image.point_colors.copy()
    _code_boundary(coder, image.foundation, steps, image.strides.boundary, boundary_colors)
    _code_points(coder, image, _bitmap(image), boundary_colors, point_colors, fit=fit)
    return boundary_colors, point_colors


def sealed(stream: bytes, version: int = VERSION) -> bytes:
    """The file with this stream: letters, version, and a checksum, which covers the version since it is 3."""
    number = bytes([version])
    checksum = zlib.crc32(stream, zlib.crc32(number) if version > 2 else 0)
    return MAGIC + number + struct.pack("<I", checksum) + stream


def decode(data: bytes) -> VectorImage:
    """The vector image of a file; `InputError` when the file is not whole."""
    if data[:3] != MAGIC:
        raise InputError("not a gcvec file", code="broken-gcv")
    if len(data) < 8 or data[3] not in READABLE:
        raise InputError("a gcvec file of a version this program does not know", code="broken-gcv")
    if data != sealed(data[8:], data[3]):
        raise InputError("the file is damaged or cut short", code="broken-gcv")
    coder = range_coder.reader(data[8:])
    try:
        return _read(coder, data[3], len(data) - 8)
    except (ValueError, IndexError, RuntimeError, ArithmeticError) as problem:
        raise InputError(f"the file is damaged: {problem}", code="broken-gcv") from problem


def _write(
    coder: Coder,
    image: VectorImage,
    boundary_colors: Floats,
    point_colors: Floats,
    shifts: Ints | None,
    fit: ColorFit | None,
) -> tuple[int, int]:
    """Write everything, `shifts` `(p, 3)` of colours too; the colours become what a decoder sees, rounded to
    a `fit` if it is given.

    Returns how many bytes of labels, and how many curves and control points.
    """
    network, steps = image.network, image.quantization
    sizes = [network.width, network.height, network.n_nodes, len(network.curves), len(network.loops)]
    text = np.frombuffer(json.dumps(image.labels, ensure_ascii=False).encode(), np.uint8).astype(np.int64)
    edits = (0 if image.control_points is None else MOVED) + (0 if shifts is None else RECOLORED)
    if len(text) >> LONGEST:
        raise InputError(f"labels of {len(text)} bytes are too long for a file", code="labels-too-long")
    _code_sizes(coder, np.array([*sizes, *astuple(steps), edits, len(text)]))
    code_text(coder, fresh_model(TEXT_COUNTERS, TEXT_ROWS, TEXT_INPUTS), text)
    table = np.array(
        [
            (c.left, c.right, c.start, c.end, c.level, c.segments, h)
            for c, h in zip(network.curves, image.hard, strict=True)
        ]
    )
    _code_topology(coder, table)
    curves = _geometry_model()
    reference = network.control_points.copy()
    _code_positions(coder, curves, table, steps, reference)
    if image.control_points is not None:
        _code_positions(coder, curves, table, steps, image.control_points.copy())
    occupied = _bitmap(image)
    _code_occupancy(coder, occupied)
    _code_boundary(coder, image.foundation, steps, image.strides.boundary, boundary_colors)
    _code_points(coder, image, occupied, boundary_colors, point_colors, fit=fit)
    if shifts is not None:
        _code_shifts(coder, shifts)
    return len(text), len(table) + len(reference) + len(image.points)


def _bitmap(image: VectorImage) -> NDArray[np.uint8]:
    """`(h, w)` 1 where there are interior control points."""
    occupied = np.zeros((image.height, image.width), np.uint8)
    occupied[image.points[:, 1], image.points[:, 0]] = 1
    return occupied


def _read(coder: Coder, version: int, length: int) -> VectorImage:
    """Read everything; `length` is that of the stream, which bounds what may be in it."""
    sizes = np.zeros(10, np.int64)
    _code_sizes(coder, sizes)
    width, height, n_nodes, n_curves, n_patches = (int(n) for n in sizes[:5])
    position_bits, *color_steps = (int(n) for n in sizes[5:8])
    steps = Quantization(position_bits, *(step * STEP_UNITS[version] for step in color_steps))
    edits = int(sizes[8])
    demand(0 <= edits <= MOVED + (RECOLORED if version >= FIRST_RECOLORED else 0), "unknown edits")
    limits.check_sizes(width, height, n_nodes, n_curves, n_patches, length)
    limits.check_steps(steps)
    labels = _read_labels(coder, int(sizes[9]), n_patches, length)
    table = np.zeros((n_curves, 7), np.int64)
    _code_topology(coder, table)
    limits.check_topology(table, n_nodes, n_patches, length)
    curves = _geometry_model()
    reference = _read_positions(coder, curves, table, steps, width, height)
    moved = _read_positions(coder, curves, table, steps, width, height) if edits & MOVED else None
    network = _network(width, height, n_nodes, n_patches, table, reference)
    hard = table[:, HARD].astype(bool)
    foundation = lay_foundation(network, hard, moved)
    demand(_fills_frame(foundation), "curves that do not fit together")
    boundary_colors = np.zeros((foundation.space.size, 3))
    if version < FIRST_WEIGHED:
        _code_boundary(
            coder, foundation, steps, even_strides(len(boundary_colors)), boundary_colors, FRACTION
        )
        _check_whole(coder)
    occupied = np.zeros((height, width), np.uint8)
    _code_occupancy(coder, occupied)
    _check_whole(coder)
    ys, xs = np.nonzero(occupied)
    limits.check_points(n_curves + len(reference) + len(xs), length)
    points = np.stack([xs, ys], axis=1).astype(np.int64)
    canvas = lay_canvas(foundation, points)
    drawing, *_ = canvas.unit
    demand(len(drawing.triangles) > 0, "curves that do not fit together")
    point_colors = np.zeros((len(points), 3))
    image = VectorImage(network, hard, boundary_colors, points, point_colors, labels, steps, moved)
    image = image.knowing(canvas)
    if version >= FIRST_WEIGHED:
        _code_boundary(coder, foundation, steps, image.strides.boundary, boundary_colors)
    _code_points(coder, image, occupied, boundary_colors, point_colors, version)
    _check_whole(coder)
    if version < FIRST_WEIGHED:
        # No colour is to become coarser in the file of an edited picture.
        finer = steps.scaled(FRACTION / COARSEST_STRIDE)
        image = replace(image, quantization=finer).knowing(canvas)
    if not edits & RECOLORED:
        return image
    shifts = np.zeros((n_patches, 3), np.int64)
    _code_shifts(coder, shifts)
    _check_whole(coder)
    return recolored(image, shifts)


def _check_whole(coder: Coder) -> None:
    demand(range_coder.overrun(coder) == 0, "cut short")


def _fills_frame(foundation: Foundation) -> bool:
    """Whether the parameter domains cover all of the picture, and nothing outside it."""
    domain, size = foundation.samples.domain, (foundation.network.width, foundation.network.height)
    inside = (domain >= 0).all() and (domain <= size).all()
    mesh = foundation.geometry.mesh
    corners = mesh.vertices[mesh.triangles]
    area = np.linalg.det(corners[:, 1:] - corners[:, :1]).sum() / 2
    filled = np.isclose(area, size[0] * size[1]) and (foundation.geometry.triangle_at >= 0).all()
    return bool(inside and filled)


def _code_sizes(coder: Coder, sizes: Ints) -> None:
    code_sequence(coder, fresh_model(SEQUENCE_COUNTERS, SEQUENCE_ROWS, SEQUENCE_INPUTS), sizes)


def _code_topology(coder: Coder, table: Ints) -> None:
    code_topology(coder, fresh_model(TOPOLOGY_COUNTERS, TOPOLOGY_ROWS, TOPOLOGY_INPUTS), table)


def _geometry_model() -> Model:
    return fresh_model(GEOMETRY_COUNTERS, GEOMETRY_ROWS, GEOMETRY_INPUTS)


def _code_occupancy(coder: Coder, occupied: NDArray[np.uint8]) -> None:
    code_occupancy(coder, fresh_model(OCCUPANCY_COUNTERS, OCCUPANCY_ROWS, OCCUPANCY_INPUTS), occupied)


def _code_shifts(coder: Coder, shifts: Ints) -> None:
    """Write what recolours add to the colours `(p, 3)` of each patch, or read it into zeros.

    Only patches that are shifted are there: each with how many before it are not, since the last one.
    """
    model = fresh_model(SEQUENCE_COUNTERS, SEQUENCE_ROWS, SEQUENCE_INPUTS)
    patches = np.flatnonzero(shifts.any(axis=1))
    count = np.array([len(patches)])
    code_sequence(coder, model, count)
    demand(0 <= count[0] <= len(shifts), "an impossible number of recolours")
    rows = np.zeros((int(count[0]), 4), np.int64)
    rows[: len(patches), 0] = np.diff(patches, prepend=-1) - 1
    rows[: len(patches), 1:] = shifts[patches]
    for row in rows:
        code_sequence(coder, model, row)
    patches = np.cumsum(rows[:, 0] + 1) - 1
    demand((rows[:, 0] >= 0).all() and (patches < len(shifts)).all(), "a recolour of an unknown patch")
    demand((np.abs(rows[:, 1:]) <= FULL_SHIFT).all(), "an impossible recolour")
    shifts[patches] = rows[:, 1:]


def _read_labels(coder: Coder, n_bytes: int, n_patches: int, length: int) -> tuple[str, ...]:
    limits.check_text(n_bytes, length)
    text = np.zeros(n_bytes, np.int64)
    code_text(coder, fresh_model(TEXT_COUNTERS, TEXT_ROWS, TEXT_INPUTS), text)
    _check_whole(coder)
    labels = json.loads(text.astype(np.uint8).tobytes().decode())
    demand(isinstance(labels, list) and len(labels) == n_patches, "labels that do not fit the patches")
    demand(all(isinstance(label, str) for label in labels), "labels that are no text")
    return tuple(map(plain_text, labels))


def _read_positions(
    coder: Coder, curves: Model, table: Ints, steps: Quantization, width: int, height: int
) -> Floats:
    control_points = np.zeros((int(control_counts(table).sum()), 2))
    _code_positions(coder, curves, table, steps, control_points)
    _check_whole(coder)
    limits.check_places(control_points, width, height)
    return control_points


def _code_positions(
    coder: Coder, curves: Model, table: Ints, steps: Quantization, control_points: Floats
) -> None:
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
    code_geometry(coder, curves, table, offsets, nodes, places)
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


def _code_boundary(
    coder: Coder,
    foundation: Foundation,
    steps: Quantization,
    strides: Ints,
    colors: Floats,
    first_stride: int = FIRST_STRIDE,
) -> None:
    """Write the boundary colours, or read them; either way `colors` becomes what a decoder sees."""
    offsets, unknown = foundation.samples.offsets, foundation.space.of_control
    sides: list[tuple[Ints, int, int]] = []
    for c, curve in enumerate(foundation.network.curves):
        twin = -1
        for side, patch in ((RIGHT, curve.right), (LEFT, curve.left)):
            if patch != OUTSIDE:
                sides.append((unknown[side, offsets[c] : offsets[c + 1]], patch, twin))
                twin = len(sides) - 1
    unknowns, patches, twins = zip(*sides, strict=True)
    coordinates = np.zeros(colors.shape, np.int64)
    code_boundary_colors(
        coder,
        fresh_model(BOUNDARY_COUNTERS, BOUNDARY_ROWS, BOUNDARY_INPUTS),
        np.concatenate(unknowns),
        np.cumsum([0, *map(len, unknowns)]),
        np.array(patches),
        np.array(twins),
        len(foundation.network.loops),
        strides,
        first_stride,
        to_coordinates(colors - GRAY, steps.boundary),
        coordinates,
    )
    colors[:] = GRAY + from_coordinates(coordinates, steps.boundary)


def _code_points(
    coder: Coder,
    image: VectorImage,
    occupied: NDArray[np.uint8],
    boundary_colors: Floats,
    colors: Floats,
    version: int = VERSION,
    fit: ColorFit | None = None,
) -> None:
    """Write the interior colours, or read them; either way `colors` becomes what a decoder sees, as
    `boundary_colors` are. They are rounded to a `fit` if it is given."""
    base = predicted_colors(image.foundation, boundary_colors, image.points)
    coordinates, step = np.zeros(colors.shape, np.int64), image.quantization.point
    patch = image.patch_of_points
    if version >= FIRST_BLENDED:
        around, along = image.neighborhoods, ALONG
    else:
        around = neighborhoods(image.points, patch, image.height, image.width, FORMER_NEIGHBORS)
        along = NOT_ALONG
    if version >= FIRST_WEIGHED:
        strides, crowds = image.strides.points, crowds_by_stride(image.strides.points)
    else:
        strides, crowds = even_strides(len(image.points)), former_crowds(image.points, occupied)
    echo = silence()
    if fit is not None:
        echo = echo_of(fit, boundary_colors - image.boundary_colors, len(colors), step)
    code_point_colors(
        coder,
        fresh_model(POINT_COUNTERS, POINT_ROWS, POINT_INPUTS),
        image.points,
        patch,
        occupied,
        around,
        along,
        strides,
        crowds,
        echo,
        to_coordinates(colors - base, step),
        coordinates,
    )
    colors[:] = base + from_coordinates(coordinates, step)


def predicted_colors(foundation: Foundation, boundary_colors: Floats, points: Ints) -> Floats:
    """Colours `(n, 3)` that the patches without interior control points have at pixels `points` `(n, 2)`."""
    operator, corner_color = foundation.bare_colors
    colors: Floats = operator @ boundary_colors
    return foundation.geometry.interpolate(points.astype(np.float64) + 0.5, colors[corner_color])
