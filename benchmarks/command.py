"""The command as it is used: from its start to its end."""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from benchmarks.child import peak_memory
from benchmarks.pictures import picture
from gcvec.export.png import png

RUNS = 3


def whole_command(name: str, megapixels: float, target_mse: float) -> dict[str, Any]:
    """Seconds that `gcvec vectorize` takes as a process, the median of some runs, and the most memory of it,
    bytes."""
    with tempfile.TemporaryDirectory() as folder:
        photo = Path(folder) / "photo.png"
        photo.write_bytes(png(picture(name, megapixels)))
        command = [sys.executable, "-c", "from gcvec.cli import main; main()", "vectorize", str(photo)]
        command += [
            "-o",
            str(photo.with_suffix(".gcv")),
            "--max-points",
            "0",
            "--target-mse",
            str(target_mse),
        ]
        seconds = []
        for _ in range(RUNS):
            started = time.perf_counter()
            subprocess.run(command, check=True, capture_output=True)
            seconds.append(time.perf_counter() - started)
    return {"seconds": statistics.median(seconds), "peak": peak_memory(resource.RUSAGE_CHILDREN)}
