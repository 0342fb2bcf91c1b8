"""How a process of ours keeps its memory."""

from __future__ import annotations

import ctypes
import sys

LARGE = 8 << 20
"""An array of so many bytes is given back as soon as it is let go."""

KEPT = 64 << 20
"""So many bytes of what smaller ones leave are kept at hand."""

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD = -1, -3


def give_back_large_arrays() -> None:
    """Keep memory from coming to pieces, as it does where arrays of many sizes come and go; with glibc only.

    By itself that keeps arrays of up to 32 MB among the small ones once it has seen some, and then holds
    nearly twice what a large picture needs (mallopt(3)). For the process: so not for libraries to decide.
    """
    if sys.platform != "linux":
        return
    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(_M_MMAP_THRESHOLD, LARGE)
        mallopt(_M_TRIM_THRESHOLD, KEPT)
