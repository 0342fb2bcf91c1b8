"""Erosion and dilation of masks `(h, w)` by one pixel along an axis, or both."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]


def eroded(mask: Mask, rows: bool, columns: bool) -> Mask:
    """What keeps both neighbours along the named axes; beyond the frame there is nothing."""
    kept = mask.copy()
    if rows:
        kept[1:] &= mask[:-1]
        kept[:-1] &= mask[1:]
        kept[0] = kept[-1] = False
    if columns:
        kept[:, 1:] &= mask[:, :-1]
        kept[:, :-1] &= mask[:, 1:]
        kept[:, 0] = kept[:, -1] = False
    return kept


def dilated(mask: Mask, rows: bool, columns: bool) -> Mask:
    """What is in the mask, or has a neighbour in it along one of the named axes."""
    grown = mask.copy()
    if rows:
        grown[1:] |= mask[:-1]
        grown[:-1] |= mask[1:]
    if columns:
        grown[:, 1:] |= mask[:, :-1]
        grown[:, :-1] |= mask[:, 1:]
    return grown


def dilated_by_square(mask: Mask) -> Mask:
    """What is in the mask, or has one of its eight neighbours in it."""
    return dilated(dilated(mask, rows=True, columns=False), rows=False, columns=True)
