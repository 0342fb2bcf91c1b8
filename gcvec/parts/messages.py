"""What a coordinator and its helpers hand each other, as `.npz` files: arrays of numbers and nothing else."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gcvec.curves.loops import network_loops
from gcvec.curves.network import Curve, Network

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

VERSION = 3
"""Of the messages: those of another are not read."""

_DAMAGES = (
    ValueError,
    KeyError,
    TypeError,
    IndexError,
    OSError,
    EOFError,
    NotImplementedError,
    RuntimeError,
    struct.error,
    zipfile.BadZipFile,
    zlib.error,
)
"""What reading a file raises that is not whole."""


class DamagedPartError(Exception):
    """A file is not what was written. The message names the cause in one line."""


@dataclass(frozen=True)
class PartRequest:
    """One round of one part. Squared errors are of colours in [0, 1], summed over pixels and channels.

    number      of the part
    rounds      done before this one; before the first the part has no points and is seeded
    network     the curves of the part, in its own frame
    hard        (c,) bool, of each curve
    prior       (b, 3) first estimates of its boundary colours
    points      (n, 2) int64, its control points by rows, in its own frame
    colors      (b + n, 3) its colours so far, boundary first
    target_mse  what the whole picture has to come to (0-255 scale)
    axes        of colour along which it varies
    goal        the squared error wanted of the part
    shares      of the control points to take out and place anew, turn after turn; 0: to grow
    max_points  of a region, 0: any number
    bias        the error that greedy placement expected of the last round over what it was
    shared      (k,) int64, pixels of the frame that the part shares with others
    wanted      (k, 3) float32, what it is wanted to give to them
    """

    number: int
    rounds: int
    network: Network
    hard: NDArray[np.bool_]
    prior: Floats
    points: Ints
    colors: Floats
    target_mse: float
    axes: int
    goal: float
    shares: tuple[float, ...]
    max_points: int
    bias: float
    shared: Ints
    wanted: NDArray[np.float32]


@dataclass(frozen=True)
class PartResult:
    """A part after a round.

    number  of the part
    points  (n, 2) int64, its control points by rows, in its own frame
    colors  (b + n, 3) its colours
    square  its squared error, and that at shared pixels, which is measured against what was wanted there
    lack    so much of it there is because regions that may have no more points are worse than wanted
    course  (k, 2) how many points it had, and its squared error, turn after turn
    bias    see `PartRequest`
    rise    see `Refinement`: 0 unless points were taken out in this round
    worst   its largest absolute error (0-255 scale)
    grown   (g,) int64, its patches that got points
    more    whether more points would help
    shared  (k,) int64, pixels of the frame that it shares with others
    cover   (k,) float32, the share of them that it covers
    given   (k, 3) float32, what it gives to them
    """

    number: int
    points: Ints
    colors: Floats
    square: float
    lack: float
    square_shared: float
    course: Floats
    bias: float
    rise: float
    worst: float
    grown: Ints
    more: bool
    shared: Ints
    cover: NDArray[np.float32]
    given: NDArray[np.float32]


def request_bytes(request: PartRequest) -> bytes:
    """The file of a request."""
    network = request.network
    curves = [
        (c.left, c.right, c.start, c.end, c.level, len(c.control_points), hard)
        for c, hard in zip(network.curves, request.hard, strict=True)
    ]
    frame = network.width, network.height, *(network.origin or (0, 0))
    counts = request.number, request.rounds, request.max_points, request.axes
    return _packed(
        "request",
        frame=np.array([*frame, network.n_nodes, len(network.loops)]),
        curves=np.array(curves, np.int64),
        control=network.control_points,
        prior=request.prior,
        points=request.points,
        colors=request.colors,
        counts=np.array(counts, np.int64),
        aims=np.array([request.target_mse, request.goal, request.bias]),
        shares=np.array(request.shares, np.float64),
        shared=request.shared,
        wanted=request.wanted,
    )


def request_from(data: bytes) -> PartRequest:
    """The request in a file. Raises DamagedPartError."""
    with _reading(data, "request") as file:
        return _request(file)


def result_bytes(result: PartResult) -> bytes:
    """The file of a result."""
    return _packed(
        "result",
        points=result.points,
        colors=result.colors,
        course=result.course,
        grown=result.grown,
        counts=np.array([result.number, result.more], np.int64),
        figures=np.array(
            [result.square, result.lack, result.square_shared, result.bias, result.rise, result.worst]
        ),
        shared=result.shared,
        cover=result.cover,
        given=result.given,
    )


def result_from(data: bytes) -> PartResult:
    """The result in a file. Raises DamagedPartError."""
    with _reading(data, "result") as file:
        return _result(file)


def _packed(kind: str, **arrays: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, kind=np.array(f"{kind} {VERSION}"), **arrays)
    return buffer.getvalue()


@contextmanager
def _reading(data: bytes, kind: str) -> Iterator[Any]:
    """The arrays of a file by name."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            if str(file["kind"]) != f"{kind} {VERSION}":
                raise ValueError(f"not a {kind} of this version")
            yield file
    except _DAMAGES as problem:
        raise DamagedPartError(f"the {kind} of a part is damaged: {problem}") from problem


def _request(file: Any) -> PartRequest:
    width, height, column, row, n_nodes, n_patches = file["frame"].tolist()
    table, control, points = file["curves"], file["control"], _pairs(file["points"])
    ends = np.cumsum(table[:, 5])
    _demand(len(control) == ends[-1])
    rows = zip(np.split(control, ends[:-1]), table.tolist(), strict=True)
    curves = tuple(
        Curve(own, left, right, start, end, level) for own, (left, right, start, end, level, _, _) in rows
    )
    network = Network(width, height, n_nodes, curves, network_loops(curves, n_patches), (column, row))
    prior, colors = file["prior"], file["colors"]
    _demand(prior.shape[1:] == (3,) and colors.shape == (len(prior) + len(points), 3))
    number, rounds, max_points, axes = file["counts"].tolist()
    target_mse, goal, bias = file["aims"].tolist()
    shared, wanted = file["shared"], file["wanted"]
    _demand(shared.ndim == 1 and wanted.shape == (len(shared), 3))
    return PartRequest(
        number=number,
        rounds=rounds,
        network=network,
        hard=table[:, 6].astype(bool),
        prior=prior,
        points=points,
        colors=colors,
        target_mse=target_mse,
        axes=axes,
        goal=goal,
        shares=tuple(file["shares"].tolist()),
        max_points=max_points,
        bias=bias,
        shared=shared,
        wanted=wanted,
    )


def _result(file: Any) -> PartResult:
    points, colors = _pairs(file["points"]), file["colors"]
    _demand(colors.shape[1:] == (3,) and len(colors) >= len(points))
    number, more = file["counts"].tolist()
    square, lack, square_shared, bias, rise, worst = file["figures"].tolist()
    shared, cover, given = file["shared"], file["cover"], file["given"]
    _demand(shared.ndim == 1 and cover.shape == shared.shape and given.shape == (len(shared), 3))
    course, grown = file["course"], file["grown"]
    _demand(course.shape[1:] == (2,) and grown.ndim == 1)
    return PartResult(
        number=number,
        points=points,
        colors=colors,
        square=square,
        lack=lack,
        square_shared=square_shared,
        course=course,
        bias=bias,
        rise=rise,
        worst=worst,
        grown=grown,
        more=bool(more),
        shared=shared,
        cover=cover,
        given=given,
    )


def _pairs(points: Ints) -> Ints:
    _demand(points.shape[1:] == (2,) and points.dtype == np.int64)
    return points


def _demand(holds: bool) -> None:
    if not holds:
        raise ValueError("arrays that do not belong together")
