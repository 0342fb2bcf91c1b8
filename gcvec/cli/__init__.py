"""The `gcvec` command."""

from __future__ import annotations

import gc
import os
import sys


def main() -> None:
    """Run the command line and end the process with its exit code."""
    # What is loaded and made stays to the end: to look for unreachable cycles meanwhile only takes time.
    gc.disable()
    # Numerical libraries read these once, when they are loaded: threads of our own share the cores better.
    for library in ("OPENBLAS", "OMP", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    if sys.stderr is None:  # the caller has closed it: what is told there is for nobody
        sys.stderr = open(os.devnull, "w", errors="backslashreplace")  # noqa: SIM115 - stays open
    try:
        from gcvec.cli._app import run
        from gcvec.cli._postponed import postpone

        postpone()
        code = run(sys.argv[1:])
    except KeyboardInterrupt:
        code = 130
    gc.freeze()  # nor at the end of the process
    sys.exit(code)
