"""Editing a vector image (paper, section 5.2): move the control points of its curves, recolour its patches.

Nothing is fitted or solved again: parameter domains, the mesh on them and all coordinates stay, and equation
(1) is linear in the control points. Moves count in steps of the file's grid, so they are saved exactly and
can be taken back exactly; recolours are shifts beside the colours of before, and leave all other patches as
they are.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gcvec.codec.limits import too_far
from gcvec.curves.network import Network, straight_line
from gcvec.errors import InputError, pointing_at
from gcvec.hex_color import rgb_from_hex
from gcvec.patches.canonical import Canvas, Foundation
from gcvec.patches.mesh import patch_mesh
from gcvec.patches.patch import Blend
from gcvec.raster.triangle import double_areas
from gcvec.recoloring import FULL_SHIFT, recolored, shifted
from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Move:
    """Shift control point `index` of curve `curve` by (`dx`, `dy`) pixels.

    The end of a curve takes along every curve that ends there. On the picture's frame it moves only along it.
    """

    curve: int
    index: int
    dx: float
    dy: float


@dataclass(frozen=True)
class Recolor:
    """Give patch `patch` the mean colour `color`, sRGB in [0, 1], and keep its differences from the mean."""

    patch: int
    color: tuple[float, float, float]


def hex_color(text: str) -> tuple[float, float, float]:
    """sRGB in [0, 1] of a colour written as `#rrggbb`. Raises `InputError` ("bad-option")."""
    red, green, blue = rgb_from_hex(text, "color")
    return red / 255, green / 255, blue / 255


def edit(image: VectorImage, moves: Sequence[Move] = (), recolors: Sequence[Recolor] = ()) -> VectorImage:
    """The vector image after the moves, all at once, and then the recolours, the last one of each patch.

    `foldovers` of the result counts the triangles that the moves turned over. Raises `InputError`, naming the
    curve, control point or patch, for what does not exist or cannot move.
    """
    made_of = image.recoloring
    original = made_of.original if made_of else image
    shifts = made_of.shifts.copy() if made_of else np.zeros((len(image.labels), 3), np.int64)
    if moves:
        original = _moved(original, moves)
    means: dict[int, Floats] = {}
    for number, recolor in enumerate(recolors):
        with pointing_at(f"recolors/{number}"):
            means[_checked_patch(image, recolor.patch)] = _checked_color(recolor)
    for patch, mean in means.items():
        shifts[patch] = _shift_towards(original, patch, mean)
    return recolored(original, shifts)


def mean_color(image: VectorImage, patch: int) -> Floats:
    """Mean sRGB colour `(3,)` in [0, 1] of a patch, over its area."""
    weights, own = _mean_weights(image, _checked_patch(image, patch))
    return np.asarray(weights @ image.colors[own])


def _mean_weights(image: VectorImage, patch: int) -> tuple[Floats, Ints]:
    """How much each colour, `(b + k,)`, counts in the mean of a patch, and which of the picture's they are:
    those along all curves, then those of its k control points."""
    canvas, own_points = _patch_canvas(image.canvas, patch)
    drawing = canvas.drawing(flatness=np.inf)
    operator, corner_color = canvas.operator(drawing)
    area = np.abs(double_areas(drawing.image, drawing.triangles))
    area = area if area.any() else np.ones_like(area)  # an edit may have taken it all away
    of_corner = np.bincount(corner_color.ravel(), np.repeat(area / (3 * area.sum()), 3), operator.shape[0])
    n_boundary = len(image.boundary_colors)
    own = np.concatenate([np.arange(n_boundary), n_boundary + own_points])
    return np.asarray(operator.T @ of_corner), own


def _moved(image: VectorImage, moves: Sequence[Move]) -> VectorImage:
    network, foundation = image.network, image.foundation
    control_points = foundation.control_points.copy()
    grid = image.quantization.grid
    for number, move in enumerate(moves):
        with pointing_at(f"moves/{number}"):
            taken_along = _control_points_moved_by(network, foundation, move)
            control_points[taken_along] += np.round(np.array([move.dx, move.dy]) / grid) * grid
            if too_far(control_points[taken_along], network.width, network.height).any():
                raise InputError(
                    f"control point {move.index} of curve {move.curve} would leave the picture far behind",
                    code="bad-move",
                )
    with pointing_at("moves"):
        _keep_frame_straight(network, foundation, control_points)
    geometry = foundation.geometry.moved(foundation.samples, control_points)
    foundation = replace(foundation, geometry=geometry, control_points=control_points)
    mesh = image.canvas.mesh
    places = geometry.to_image(mesh.vertices[mesh.n_samples :])
    canvas = replace(image.canvas, foundation=foundation, places=places)
    unmoved = np.array_equal(control_points, network.control_points)
    edited = replace(image, control_points=None if unmoved else control_points, report=None)
    return edited.knowing(canvas)


def _control_points_moved_by(network: Network, foundation: Foundation, move: Move) -> Ints:
    """Control points, numbered through all curves, that a move shifts."""
    if not 0 <= move.curve < len(network.curves):
        last = len(network.curves) - 1
        raise InputError(f"there is no curve {move.curve}: they count from 0 to {last}", code="unknown-curve")
    curve = network.curves[move.curve]
    last = len(curve.control_points) - 1
    name = f"control point {move.index} of curve {move.curve}"
    if not 0 <= move.index <= last:
        raise InputError(f"there is no {name}: they count from 0 to {last}", code="unknown-control-point")
    if not (math.isfinite(move.dx) and math.isfinite(move.dy)):
        raise InputError(f"{name} cannot move by {move.dx}, {move.dy}", code="bad-move")
    if curve.closed or 0 < move.index < last:
        if curve.on_frame:
            raise InputError(f"{name} lies on the picture's frame, which stays straight", code="bad-move")
        return foundation.samples.offsets[move.curve : move.curve + 1] + move.index
    node = curve.start if move.index == 0 else curve.end
    for frame in (c for c in network.curves if c.on_frame and node in (c.start, c.end)):
        across = move.dy if frame.control_points[0, 1] == frame.control_points[-1, 1] else move.dx
        if across:
            raise InputError(f"{name} lies on the picture's frame and moves only along it", code="bad-move")
    return _ends_at(network, foundation, node)


def _ends_at(network: Network, foundation: Foundation, node: int) -> Ints:
    first, past = foundation.samples.offsets[:-1], foundation.samples.offsets[1:]
    starts = [first[c] for c, curve in enumerate(network.curves) if curve.start == node]
    ends = [past[c] - 1 for c, curve in enumerate(network.curves) if curve.end == node]
    return np.array(starts + ends)


def _keep_frame_straight(network: Network, foundation: Foundation, control_points: Floats) -> None:
    """Lay the curves on the frame anew between their ends, which must not have passed each other."""
    offsets = foundation.samples.offsets
    for c, curve in enumerate(network.curves):
        if not curve.on_frame:
            continue
        own = slice(offsets[c], offsets[c + 1])
        ends = control_points[own][[0, -1]]
        before = curve.control_points[-1] - curve.control_points[0]
        if (ends[1] - ends[0]) @ before <= 0:
            raise InputError(
                f"the ends of curve {c}, on the picture's frame, would pass each other", code="bad-move"
            )
        control_points[own] = straight_line(ends[0], ends[1], curve.segments)


def _shift_towards(original: VectorImage, patch: int, mean: Floats) -> Ints:
    """The shift `(3,)`, in steps, that brings the mean colour of a patch closest to `mean` `(3,)`.

    Coordinates sum to one, so colours that are shifted alike shift the patch by as much everywhere; those
    that would leave the gamut stay at its edge, and the others are shifted further.
    """
    weights, own = _mean_weights(original, patch)
    colors = np.concatenate([original.boundary_colors, original.point_colors])[own]  # as they are shifted
    return np.array([_shift_to_mean(colors[:, k], weights, mean[k]) for k in range(3)])


def _shift_to_mean(values: Floats, weights: Floats, mean: float) -> int:
    """The shift after which values `(n,)` have the weighted mean closest to this one."""

    def off(shift: int) -> float:
        return round(float(weights @ shifted(values, shift)) - mean, 9)

    shifts = range(1 - FULL_SHIFT, FULL_SHIFT)
    enough = shifts.start + bisect_left(shifts, 0.0, key=off)
    return min(enough - 1, enough, key=lambda shift: abs(off(shift)))


def _patch_canvas(canvas: Canvas, patch: int) -> tuple[Canvas, Ints]:
    """The part of a canvas that belongs to one patch, and which control points that patch has."""
    mesh = canvas.mesh
    part, kept = patch_mesh(mesh, patch)
    points = kept[part.n_samples : part.first_free] - mesh.n_samples
    free = kept[part.first_free :] - mesh.first_free
    blend = Blend(canvas.blend.boundary[free], canvas.blend.points[free][:, points])
    places = canvas.places[kept[part.n_samples :] - mesh.n_samples]
    return Canvas(canvas.foundation, part, blend, places), points


def _checked_color(recolor: Recolor) -> Floats:
    color = np.array(recolor.color, np.float64)
    if color.shape != (3,) or not ((color >= 0) & (color <= 1)).all():
        raise InputError(f"patch {recolor.patch} cannot have colour {recolor.color}", code="bad-color")
    return color


def _checked_patch(image: VectorImage, patch: int) -> int:
    if not 0 <= patch < len(image.labels):
        last = len(image.labels) - 1
        raise InputError(f"there is no patch {patch}: they count from 0 to {last}", code="unknown-patch")
    return patch
