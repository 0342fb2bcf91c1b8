"""What annotators leave between regions: thin gaps close, real background stays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gcvec.disjoint_sets import united
from gcvec.kernels import kernel
from gcvec.morphology import Mask, dilated, dilated_by_square, eroded

UNCOVERED = -1
"""The owner of pixels that no shape covers."""

_REACH = 4
"""A gap pixel takes the nearest owner within this distance, pixels."""

_FRAME_RUN = 5
"""A thin component with more pixels than this on the picture's frame is a strip along it."""

_TOUCHING = (
    (np.s_[:, :-1], np.s_[:, 1:]),
    (np.s_[:-1], np.s_[1:]),
    (np.s_[:-1, :-1], np.s_[1:, 1:]),
    (np.s_[:-1, 1:], np.s_[1:, :-1]),
)
"""Where pixels are, and those next to them: to the right, and the three below."""


def close_gaps(owners: NDArray[np.int32]) -> None:
    """Give the pixels of thin gaps to their nearest owner, in place; `owners (h, w)`, -1 where uncovered.

    Thin is where neither a 5 x 5 square nor a diamond of 7 pixels fits. Thin pixels are a gap where they
    separate two owners or run along the picture's frame; the acute corners of real background are neither.
    """
    uncovered = owners == UNCOVERED
    thin = uncovered & ~(_opened_by_square(uncovered) | _opened_by_diamond(uncovered))
    if not thin.any():
        return
    components = _components(thin)
    gaps = _is_gap(owners, components)[components]
    _take_nearest(owners, owners.copy(), np.ascontiguousarray(np.argwhere(gaps)), _offsets(_REACH))


def _components(mask: Mask) -> NDArray[np.int64]:
    """Number the components of a mask from 1, pixels that touch at a corner being connected; 0 outside."""
    number = np.cumsum(mask).reshape(mask.shape) - 1
    pairs = []
    for here, there in _TOUCHING:
        both = mask[here] & mask[there]
        pairs.append((number[here][both], number[there][both]))
    components = np.zeros(mask.shape, np.int64)
    components[mask] = united(*map(np.concatenate, zip(*pairs, strict=True)), int(mask.sum())) + 1
    return components


def _opened_by_diamond(mask: Mask) -> Mask:
    for _ in range(3):
        mask = eroded(mask, rows=True, columns=True)
    for _ in range(3):
        mask = dilated(mask, rows=True, columns=True)
    return mask


def _opened_by_square(mask: Mask) -> Mask:
    for _ in range(2):
        mask = eroded(eroded(mask, rows=True, columns=False), rows=False, columns=True)
    for _ in range(2):
        mask = dilated_by_square(mask)
    return mask


def _offsets(reach: int) -> NDArray[np.int64]:
    """All `(dy, dx)` within `reach`, nearest first."""
    offsets = [
        (dy * dy + dx * dx, dy, dx)
        for dy in range(-reach, reach + 1)
        for dx in range(-reach, reach + 1)
        if 0 < dy * dy + dx * dx <= reach * reach
    ]
    return np.array([(dy, dx) for _, dy, dx in sorted(offsets)])


@kernel
def _is_gap(owners: NDArray[np.int32], components: NDArray[np.int64]) -> Mask:
    """Per thin component (0 is none): whether it touches two owners, or one and a stretch of the frame."""
    count = components.max() + 1
    owner = np.full(count, UNCOVERED, dtype=np.int32)
    gap = np.zeros(count, dtype=np.bool_)
    on_frame = np.zeros(count, dtype=np.int64)
    height, width = owners.shape
    for y in range(height):
        for x in range(width):
            component = components[y, x]
            if component == 0:
                continue
            if y == 0 or x == 0 or y == height - 1 or x == width - 1:
                on_frame[component] += 1
            for dy, dx in ((-1, 0), (0, -1), (0, 1), (1, 0)):
                v, u = y + dy, x + dx
                if 0 <= v < height and 0 <= u < width and owners[v, u] != UNCOVERED:
                    if owner[component] == UNCOVERED:
                        owner[component] = owners[v, u]
                    gap[component] |= owner[component] != owners[v, u]
    for component in range(count):
        gap[component] |= on_frame[component] > _FRAME_RUN and owner[component] != UNCOVERED
    return gap


@kernel
def _take_nearest(
    owners: NDArray[np.int32],
    before: NDArray[np.int32],
    pixels: NDArray[np.int64],
    offsets: NDArray[np.int64],
) -> None:
    height, width = owners.shape
    for y, x in pixels:
        for dy, dx in offsets:
            v, u = y + dy, x + dx
            if 0 <= v < height and 0 <= u < width and before[v, u] != UNCOVERED:
                owners[y, x] = before[v, u]
                break
