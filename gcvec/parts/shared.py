"""Pixels that several parts of a picture cover: what each part is wanted to give to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gcvec.parts.division import Part
from gcvec.parts.messages import PartResult


@dataclass(frozen=True)
class Shared:
    """The pixels that several parts give to.

    n       how many there are
    excess  squared error there beyond what the parts have measured themselves
    wanted  (k, 3) float32 for each part, what it is wanted to give to them
    """

    n: int
    excess: float
    wanted: tuple[NDArray[np.float32], ...]


def shared_pixels(pixels: NDArray[np.uint8], parts: Sequence[Part], states: Sequence[PartResult]) -> Shared:
    """What the photo `(h, w, 3)` lacks in shared pixels is wanted of all, by the shares that they cover."""
    width = pixels.shape[1]
    places = []
    for part, state in zip(parts, states, strict=True):
        row, column = np.divmod(state.shared, part.network.width)
        places.append((row + part.origin[1]) * width + column + part.origin[0])
    place, at = np.unique(np.concatenate(places), return_inverse=True)
    rest = pixels.reshape(-1, 3)[place] / 255.0
    np.subtract.at(rest, at, np.concatenate([state.given for state in states]))
    cuts = np.cumsum([len(own) for own in places])[:-1]
    wanted = [
        state.given + state.cover[:, None] * rest[own].astype(np.float32)
        for state, own in zip(states, np.split(at, cuts), strict=True)
    ]
    measured = sum(state.square_shared for state in states)
    return Shared(len(place), float(np.sum(rest**2)) - measured, tuple(wanted))
