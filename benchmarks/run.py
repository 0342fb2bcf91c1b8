"""Every measurement in a process of its own, bounded in time and memory: one that fails is a result too."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

LONGEST = 600.0
"""Seconds that one measurement may take."""

MEMORY_SHARE = 0.8
"""Share of the machine's memory that one measurement may use."""

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OPENBLAS", "OMP", "MKL")}
"""As the `gcvec` command has it: threads of its own share the cores better."""


@dataclass(frozen=True)
class Outcome:
    """What a measurement returned and the most memory its process held, bytes; or why there is nothing."""

    value: Any = None
    peak: int = 0
    failure: str = ""


class Run:
    """One run of the benchmarks; what has not begun after `seconds` is left out."""

    def __init__(self, seconds: float, longest: float = LONGEST, memory: int | None = None) -> None:
        self._end = time.monotonic() + seconds
        self._longest = longest
        self.memory = memory or int(MEMORY_SHARE * os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))

    def measure(self, function: Callable[..., Any], **arguments: Any) -> Outcome:
        """Call a function of a module in a new process. Arguments and result must be JSON."""
        name = f"{function.__module__}:{function.__name__}"
        shown = ", ".join(f"{key}={value}" for key, value in arguments.items())
        left = self._end - time.monotonic()
        if left <= 0:
            outcome = Outcome(failure="left out: the run's time was over")
        else:
            outcome = self._measured(name, arguments, min(self._longest, left))
        print(f"{name}({shown}): {outcome.failure or 'done'}", file=sys.stderr, flush=True)
        return outcome

    def _measured(self, name: str, arguments: dict[str, Any], seconds: float) -> Outcome:
        request = json.dumps({"function": name, "arguments": arguments, "memory": self.memory})
        command = [sys.executable, "-m", "benchmarks.child"]
        environment = {**os.environ, **ONE_THREAD}
        try:
            done = subprocess.run(
                command, input=request, env=environment, capture_output=True, text=True, timeout=seconds
            )
        except subprocess.TimeoutExpired:
            return Outcome(failure=f"longer than {seconds:.0f} s")
        if done.returncode:
            return Outcome(failure=self._reason(done))
        return Outcome(**json.loads(done.stdout.splitlines()[-1]))

    def _reason(self, done: subprocess.CompletedProcess[str]) -> str:
        last = (done.stderr.strip().splitlines() or [f"ended with code {done.returncode}"])[-1]
        if "MemoryError" in last or "Unable to allocate" in last or "bad_alloc" in done.stderr:
            return f"more than {self.memory / 1e9:.1f} GB of memory"
        return last
