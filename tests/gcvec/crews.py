"""Crews without other processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gcvec.parts.messages import PartRequest, PartResult
from gcvec.parts.part import refine_part


@dataclass(frozen=True)
class Alone:
    """A crew of nobody: the caller's own thread does one part after another."""

    parts: int

    def __call__(self, requests: Sequence[PartRequest], pixels: np.ndarray) -> list[PartResult]:
        return [refine_part(request, pixels, lambda _: None) for request in requests]
