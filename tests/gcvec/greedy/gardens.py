"""Placements on scenes, and their truth by slow and plain means."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gcvec.colors.color_fit import ColorFit, color_fit
from gcvec.greedy import Placement, Shown, begin_placement
from gcvec.greedy.seats import find_seats
from gcvec.greedy.strip import TRIANGLES, VERTICES, Strip
from gcvec.patches.canonical import Canvas, Foundation, lay_unfolded_canvas
from gcvec.refinement.clearance import find_clear_pixels
from tests.gcvec.scenes import SCENES, foundation_of, some_points

PULL = 0.1


@dataclass(frozen=True)
class Garden:
    """A placement together with what it began from."""

    foundation: Foundation
    points: np.ndarray
    canvas: Canvas
    fit: ColorFit
    colors: np.ndarray
    photo: np.ndarray
    placement: Placement


def garden(scene: str, n_points: int, left: int | None = None) -> Garden:
    """A placement on a scene with random colours at random points; `left` more of them a patch may have."""
    foundation = foundation_of(scene)
    return garden_on(foundation, SCENES[scene].picture(), some_points(foundation, n_points), left)


def garden_on(
    foundation: Foundation, picture: np.ndarray, points: np.ndarray, left: int | None = None
) -> Garden:
    """The same on any foundation and points, for a picture with noise."""
    canvas, kept = lay_unfolded_canvas(foundation, points)
    points = points[kept]
    foundation = canvas.foundation
    rng = np.random.default_rng(0)
    noise = rng.uniform(-0.1, 0.1, picture.shape)
    photo = (picture / 255.0 * 0.6 + 0.2 + noise).reshape(-1, 3).astype(np.float32)
    fit = color_fit(canvas, canvas.coverage(canvas.unit[0]), photo)
    colors = rng.uniform(0.2, 0.8, (foundation.space.size + len(points), 3))
    taken = ~find_clear_pixels(foundation)
    taken[points[:, 1], points[:, 0]] = True
    limit = None if left is None else np.full(len(foundation.network.loops), left)
    shown = Shown(canvas, points, fit.operator @ colors, fit.residual(colors, photo), photo)
    placement = begin_placement(shown, find_seats(foundation, taken), limit, PULL, 0.4)
    return Garden(foundation, points, canvas, fit, colors, photo, placement)


def alive(strip: Strip) -> np.ndarray:
    """Triangles in use."""
    triangles = np.arange(strip.counts[TRIANGLES])
    return triangles[strip.triangles[triangles, 0] >= 0]


def triangle_keys(strip: Strip) -> set[frozenset[tuple[float, float]]]:
    """The triangles as sets of places in the domain, which name vertices whatever their numbers."""
    return {
        frozenset((float(x), float(y)) for x, y in strip.domain[strip.triangles[t]]) for t in alive(strip)
    }


def painted(strip: Strip, height: int) -> np.ndarray:
    """The picture of a strip's triangles `(h w, 3)`, entry by entry."""
    picture = np.zeros((height * strip.width, 3))
    for t in alive(strip):
        for e in range(strip.first[t], strip.last[t]):
            picture[strip.first_row * strip.width + strip.pixel[e]] += (
                strip.weights[e] @ strip.color[strip.triangles[t]]
            )
    return picture


def whole_vertices(strip: Strip) -> np.ndarray:
    return np.flatnonzero(strip.whole[: strip.counts[VERTICES]])
