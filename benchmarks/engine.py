"""gcvec itself: seconds by stage, points, bytes and memory of one picture."""

from __future__ import annotations

from typing import Any, Literal

from benchmarks.child import peak_memory
from benchmarks.pictures import picture
from gcvec import Options, vectorize


def vectorized(
    name: str,
    megapixels: float,
    target_mse: float,
    strategy: Literal["batch", "paper"] = "batch",
    regions: int = 0,
    effort: int = Options.effort,
) -> dict[str, Any]:
    """The report of a run with automatic regions and no bound on points, and `base`: bytes held before it.

    The engine is warm: its kernels are loaded before the clock starts.
    """
    from gcvec.warm_up import warm_up

    pixels = picture(name, megapixels)
    warm_up()
    base = peak_memory()
    options = Options(
        strategy=strategy,
        target_mse=target_mse,
        max_points=0,
        regions=regions,
        effort=effort,
    )
    report = vectorize(pixels, None, options).report
    assert report is not None
    return {**report.as_dict(), "base": base}
