"""How loops are compiled."""

from __future__ import annotations

from typing import Any

from numba import njit

_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

bare_kernel = njit(**_OPTIONS)
"""Compiles a function that allocates nothing: it works in the arrays it is given.

Nothing is reference-counted in it. For small functions that are handed many arrays, and called for every
triangle, that is most of the time they would take.
"""
