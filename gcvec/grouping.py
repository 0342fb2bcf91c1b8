"""Things that belong to groups, given by the number of each one's group."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]


def rank_in_group(group: Ints) -> Ints:
    """How many equal numbers come before each of `group` `(n,)`."""
    order = np.argsort(group, kind="stable")
    rank = np.empty(len(group), np.int64)
    rank[order] = np.arange(len(group)) - np.searchsorted(group[order], group[order])
    return rank
