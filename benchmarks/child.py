"""The process of one measurement: reads what to call from stdin, prints what came of it as JSON."""

from __future__ import annotations

import json
import resource
import sys
from importlib import import_module


def peak_memory(whose: int = resource.RUSAGE_SELF) -> int:
    """The most memory this process has held so far, or one of its children that have ended, bytes."""
    unit = 1 if sys.platform == "darwin" else 1024
    return unit * resource.getrusage(whose).ru_maxrss


def main() -> None:
    request = json.load(sys.stdin)
    resource.setrlimit(resource.RLIMIT_DATA, (request["memory"], request["memory"]))
    module, _, function = request["function"].partition(":")
    value = getattr(import_module(module), function)(**request["arguments"])
    print(json.dumps({"value": value, "peak": peak_memory()}))


if __name__ == "__main__":
    main()
