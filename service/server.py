"""The API as a process of its own, on a socket that was opened for it: ``python -m service.server FD``."""

from __future__ import annotations

import socket
import sys
from typing import Final

import uvicorn

from service.app import create_app

KEEP_ALIVE_SECONDS: Final = 75
"""Longer than clients pause between two looks at a job, and than proxies keep a connection that is idle."""


def main() -> None:
    """Serve on the inherited listening socket whose descriptor is the first argument."""
    listener = socket.socket(fileno=int(sys.argv[1]))
    config = uvicorn.Config(
        create_app(),
        log_level="warning",
        timeout_graceful_shutdown=5,
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
        backlog=2048,
    )
    uvicorn.Server(config).run(sockets=[listener])


if __name__ == "__main__":
    main()
