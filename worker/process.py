"""What a process of the service owes the one that started it, and its neighbours."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
from contextlib import suppress
from typing import Final

_PR_SET_PDEATHSIG: Final = 1


def die_with(parent: int) -> None:
    """Have the kernel kill this process when `parent` ends, however it ends; Linux only, elsewhere nothing.

    To be called by the child. The signal comes when the *thread* that started the child ends, so children
    must be started by a thread that lives as long as its process.
    """
    if sys.platform != "linux":
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent:  # it ended before the kernel was told
        os.kill(os.getpid(), signal.SIGKILL)


def give_way() -> None:
    """Let processes that somebody waits for run as soon as they wake; Linux only, elsewhere nothing.

    This one still gets its share of the processors, in fewer and longer spans.
    """
    if sys.platform == "linux":
        with suppress(OSError):  # a sandbox may forbid it
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
