"""Editing a vector image by hand: how long one step of a drag takes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

from benchmarks.pictures import picture
from gcvec import Options, VectorImage, vectorize
from gcvec.edit import Move, Recolor, edit

RUNS = 5


def edits(name: str, megapixels: float, target_mse: float) -> dict[str, float]:
    """Seconds that it takes to move a control point and look for fold-overs, to recolour a patch, and to move
    a control point and draw the picture; each the median of some runs."""
    image = vectorize(picture(name, megapixels), None, Options(target_mse=target_mse, max_points=0))
    move, recolor = Move(_longest_curve(image), 1, 0.5, 0.5), Recolor(0, (0.4, 0.4, 0.6))
    return {
        "move": _median_seconds(lambda: edit(image, [move]).foldovers),
        "recolor": _median_seconds(lambda: edit(image, recolors=[recolor])),
        "move_and_draw": _median_seconds(lambda: edit(image, [move]).render()),
    }


def _longest_curve(image: VectorImage) -> int:
    """Of those between two patches; one on the frame, which only its ends can leave, where there is none."""
    sizes = [len(curve.control_points) * (not curve.on_frame) for curve in image.curves]
    return max(range(len(sizes)), key=sizes.__getitem__)


def _median_seconds(work: Callable[[], Any]) -> float:
    seconds = []
    for _ in range(RUNS):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return statistics.median(seconds)
