"""The `.gcv` file (paper, section 5.1).

Layout: magic `GCV`, a version byte, the CRC-32 of the rest, and one zlib stream of the parts in `_Writer` order. Geometry is
stored in steps of 1/16 pixel, boundary colours in steps of 1/255; the colours of interior control points are residuals against what
the boundary alone predicts there.
"""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.boundary import Curve, Network, straight_line
from gcvec.canonical import Foundation, lay_canvas, lay_foundation
from gcvec.color_space import color_space
from gcvec.errors import InputError
from gcvec.planar_graph import OUTSIDE
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MAGIC = b"GCV"
VERSION = 1
POSITION_STEP = 1 / 16
COLOR_STEP = 1 / 255
RESIDUAL_STEP = 2 / 255
LARGEST_PAYLOAD = 1 << 28


def rounded_network(network: Network) -> Network:
    """The network on the grid of the file: what a decoder will see, so that the fit can count on it."""
    return replace(network, curves=tuple(_rounded(c) for c in network.curves))


def _rounded(curve: Curve) -> Curve:
    control = np.round(curve.control_points / POSITION_STEP) * POSITION_STEP
    if curve.on_frame:
        control = straight_line(control[0], control[-1], curve.segments)
    return replace(curve, control_points=control)


def predicted_colors(foundation: Foundation, boundary_colors: Floats, points: Ints) -> Floats:
    """Colours `(n, 3)` that the patches without interior control points have at pixels `points`."""
    canvas = lay_canvas(foundation, np.zeros((0, 2), np.int64))
    operator, corner_color = canvas.operator(canvas.drawing(flatness=np.inf))
    colors = operator @ boundary_colors
    mesh = canvas.mesh
    triangle = foundation.geometry.triangle_at[points[:, 1], points[:, 0]]
    a, b, c = (mesh.vertices[mesh.triangles[triangle, k]] for k in range(3))
    (ux, uy), (vx, vy), (px, py) = (b - a).T, (c - a).T, (points + 0.5 - a).T
    area = ux * vy - uy * vx
    s, t = (px * vy - py * vx) / area, (ux * py - uy * px) / area
    weights = np.stack([1 - s - t, s, t], axis=1)
    return np.einsum("nk,nkc->nc", weights, colors[corner_color[triangle]])


def encode(image: VectorImage) -> bytes:
    """The file of a vector image."""
    if image.control_points is not None:
        raise NotImplementedError
    network = image.network
    writer = _Writer()
    writer.numbers([network.width, network.height, network.n_nodes, len(network.curves), len(network.loops)])
    for field in ("left", "right", "start", "end", "level", "segments"):
        writer.numbers(np.array([getattr(c, field) for c in network.curves]))
    writer.numbers(image.hard.astype(np.int64))
    writer.numbers(np.concatenate([_geometry_numbers(c) for c in network.curves]))
    writer.numbers(
        np.concatenate([np.array([len(loops), *(len(x) for x in loops)]) for loops in network.loops])
    )
    walk = [2 * c + forward for loops in network.loops for loop in loops for c, forward in loop]
    writer.numbers(np.array(walk, np.int64))
    writer.numbers(np.round(image.boundary_colors / COLOR_STEP).astype(np.int64).T.ravel())
    flat = image.points[:, 1] * network.width + image.points[:, 0]
    writer.numbers(np.diff(flat, prepend=0))
    predicted = predicted_colors(image.foundation, image.boundary_colors, image.points)
    writer.numbers(np.round((image.point_colors - predicted) / RESIDUAL_STEP).astype(np.int64).T.ravel())
    writer.text(json.dumps(image.labels))
    payload = zlib.compress(bytes(writer.data), 9)
    return MAGIC + bytes([VERSION]) + struct.pack("<I", zlib.crc32(payload)) + payload


def _geometry_numbers(curve: Curve) -> Ints:
    grid = np.round(curve.control_points / POSITION_STEP).astype(np.int64)
    if curve.on_frame:
        grid = grid[[0, -1]]
    return np.asarray(np.diff(grid, axis=0, prepend=0).ravel())


def decode(data: bytes) -> VectorImage:
    """The vector image of a file; `InputError` when the file is not whole."""
    if data[:3] != MAGIC:
        raise InputError("not a gcvec file", code="broken-gcv")
    if len(data) < 8 or data[3] != VERSION:
        raise InputError("a gcvec file of another version", code="broken-gcv")
    if zlib.crc32(data[8:]) != struct.unpack("<I", data[4:8])[0]:
        raise InputError("the file is damaged or cut short", code="broken-gcv")
    inflater = zlib.decompressobj()
    try:
        return _decoded(_Reader(inflater.decompress(data[8:], LARGEST_PAYLOAD)))
    except (zlib.error, ValueError, IndexError, TypeError, struct.error) as problem:
        raise InputError("the file is damaged or cut short", code="broken-gcv") from problem


def _decoded(reader: _Reader) -> VectorImage:
    width, height, n_nodes, n_curves, n_patches = (int(n) for n in reader.numbers())
    left, right, start, end, level, segments = (reader.numbers() for _ in range(6))
    hard = reader.numbers().astype(bool)
    numbers = reader.numbers()
    curves = []
    at = 0
    for c in range(n_curves):
        on_frame, closed = OUTSIDE in (left[c], right[c]), start[c] < 0
        n = 2 if on_frame else int(segments[c]) + (0 if closed else 3)
        control = np.cumsum(numbers[at : at + 2 * n].reshape(n, 2), axis=0) * POSITION_STEP
        at += 2 * n
        if on_frame:
            control = straight_line(control[0], control[-1], int(segments[c]))
        curves.append(Curve(control, int(left[c]), int(right[c]), int(start[c]), int(end[c]), int(level[c])))
    sizes, walk = iter(reader.numbers().tolist()), iter(reader.numbers().tolist())
    loops = tuple(
        tuple(tuple((k // 2, bool(k % 2)) for k in _take(walk, n)) for n in _take(sizes, next(sizes)))
        for _ in range(n_patches)
    )
    network = Network(width, height, n_nodes, tuple(curves), loops)
    boundary_colors = reader.numbers().reshape(3, -1).T * COLOR_STEP
    if len(boundary_colors) != color_space(network, hard).size:
        raise ValueError("the number of colours does not fit the curves")
    flat = np.cumsum(reader.numbers())
    points = np.stack([flat % width, flat // width], axis=1)
    residual = reader.numbers().reshape(3, -1).T * RESIDUAL_STEP
    labels = tuple(json.loads(reader.text()))
    foundation = lay_foundation(network, hard)
    predicted = predicted_colors(foundation, boundary_colors, points)
    image = VectorImage(network, hard, boundary_colors, points, predicted + residual, labels)
    image.__dict__["foundation"] = foundation
    return image


def _take(numbers, n):  # type: ignore[no-untyped-def]
    return [next(numbers) for _ in range(n)]


class _Writer:
    """Length-prefixed vectors of integers, zigzag-coded in the fewest bytes that hold them."""

    def __init__(self) -> None:
        self.data = bytearray()

    def numbers(self, values: Ints | list[int]) -> None:
        signed = np.asarray(values, np.int64)
        unsigned = ((signed << 1) ^ (signed >> 63)).astype(np.uint64)
        largest = int(unsigned.max(initial=0))
        size = next(n for n in (1, 2, 4, 8) if largest < 1 << (8 * n))
        planes = unsigned.astype(f"<u{size}").view(np.uint8).reshape(-1, size).T
        self.data += struct.pack("<BI", size, len(signed)) + planes.tobytes()

    def text(self, value: str) -> None:
        raw = value.encode()
        self.data += struct.pack("<I", len(raw)) + raw


class _Reader:
    """The inverse of `_Writer`; `ValueError` or `struct.error` where the data end too soon."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def _bytes(self, n: int) -> bytes:
        if self.at + n > len(self.data):
            raise ValueError("cut short")
        self.at += n
        return self.data[self.at - n : self.at]

    def numbers(self) -> Ints:
        size, count = struct.unpack("<BI", self._bytes(5))
        if size not in (1, 2, 4, 8):
            raise ValueError("bad number size")
        planes = np.frombuffer(self._bytes(size * count), np.uint8).reshape(size, count)
        unsigned = np.ascontiguousarray(planes.T).view(f"<u{size}").ravel().astype(np.uint64)
        return np.asarray(
            (unsigned >> np.uint64(1)).astype(np.int64) ^ -(unsigned & np.uint64(1)).astype(np.int64)
        )

    def text(self) -> str:
        (count,) = struct.unpack("<I", self._bytes(4))
        return self._bytes(count).decode()
