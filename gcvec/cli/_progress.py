"""What goes on around a run: a progress bar on a terminal, an interrupt."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gcvec.progress import OnProgress, Progress


@contextmanager
def quick_interrupt() -> Iterator[None]:
    """Inside, Ctrl-C ends the process at once: unwinding under compiled kernels in other threads is not safe.

    Nothing is written meanwhile, so nothing is left half written.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, _end)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _end(*_: object) -> None:
    if sys.stderr.isatty():
        os.write(sys.stderr.fileno(), b"\x1b[?25h\n")  # the bar has hidden the cursor
    os._exit(130)


@contextmanager
def progress_bar() -> Iterator[OnProgress | None]:
    """What to hand to `vectorize` as `on_progress`: a bar on stderr, None where stderr is no terminal."""
    if not sys.stderr.isatty():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, TaskProgressColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Bar

    columns = (
        TextColumn("{task.description:<8}"),
        BarColumn(),
        TaskProgressColumn(),
        TextColumn("{task.fields[state]}"),
        TimeElapsedColumn(),
    )
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("regions", total=1.0, state="")

        def show(progress: Progress) -> None:
            bar.update(
                task, completed=progress.fraction, description=progress.phase, state=describe(progress)
            )

        yield show


def describe(progress: Progress) -> str:
    """The figures of one step, e.g. `412 points, MSE 7.31`."""
    figures = []
    if progress.points:
        figures.append(f"{progress.points} points")
    if progress.mse is not None:
        figures.append(f"MSE {progress.mse:.2f}")
    return ", ".join(figures)
