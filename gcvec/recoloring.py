"""Recoloured patches: the colours of before stay, and beside them stands what is added to those of a patch.

So a recolour can be saved, changed and taken back as often as one likes: no other patch changes by as much as
a bit, and what a shift clips comes back with the next one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from gcvec.patches.canonical import Foundation
from gcvec.patches.color_space import LEFT, RIGHT, color_space

if TYPE_CHECKING:
    from gcvec.vector_image import VectorImage

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

FULL_SHIFT = 4080
"""Steps of a shift from 0 to 1: sixteen to a level of 255."""


@dataclass(frozen=True, eq=False)
class Recoloring:
    """What a picture with recoloured patches was made of.

    original  the picture of before
    shifts    (p, 3) int64, what is added to the colours of each patch, in steps of 1 / `FULL_SHIFT`
    """

    original: VectorImage
    shifts: Ints


def recolored(original: VectorImage, shifts: Ints) -> VectorImage:
    """A picture, never recoloured before, with these shifts `(p, 3)` of its patches.

    Neighbours keep their colours: soft curves around a patch that is shifted, which shared theirs, are hard.
    """
    changed: list[int] = np.flatnonzero(shifts.any(axis=1)).tolist()
    if not changed:
        return original
    before = original.foundation
    curves = original.network.curves
    around = [not c.on_frame and not {c.left, c.right}.isdisjoint(changed) for c in curves]
    hard = original.hard | np.array(around)
    foundation = replace(before, hard=hard, space=color_space(original.network, hard))
    boundary_colors = np.empty((foundation.space.size, 3))
    inside = foundation.space.of_control >= 0
    boundary_colors[foundation.space.of_control[inside]] = original.boundary_colors[
        before.space.of_control[inside]
    ]
    point_colors, patch_of_points = original.point_colors.copy(), original.patch_of_points
    for patch in changed:
        for colors, own in (
            (boundary_colors, boundary_unknowns(foundation, patch)),
            (point_colors, np.flatnonzero(patch_of_points == patch)),
        ):
            colors[own] = shifted(colors[own], shifts[patch])
    image = replace(
        original,
        hard=hard,
        boundary_colors=boundary_colors,
        point_colors=point_colors,
        recoloring=Recoloring(original, shifts),
        report=None,
    )
    return image.knowing(replace(original.canvas, foundation=foundation))


def shifted(colors: Floats, shift: Ints | int) -> Floats:
    """Colours after a shift, in steps, and kept in gamut."""
    return np.clip(colors + np.asarray(shift) / FULL_SHIFT, 0, 1)


def boundary_unknowns(foundation: Foundation, patch: int) -> Ints:
    """The colours of a patch's side of its curves."""
    offsets, of_control = foundation.samples.offsets, foundation.space.of_control
    own = [
        of_control[side, offsets[c] : offsets[c + 1]]
        for c, curve in enumerate(foundation.network.curves)
        for side, region in ((RIGHT, curve.right), (LEFT, curve.left))
        if region == patch
    ]
    return np.unique(np.concatenate(own))
