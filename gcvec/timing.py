"""Where the time goes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

STAGES = ("regions", "boundary", "mesh_harmonic", "evaluation", "optimization", "encode", "total")
"""What every report times; a picture made in parts also has the time that they took, `parts`."""


@dataclass
class StageClock:
    """Seconds by stage. Stages add up over repeated visits; they must not be nested."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start
