"""Sockets to listen on, and who can reach them."""

from __future__ import annotations

import socket
from ipaddress import ip_address
from typing import Final

_BACKLOG: Final = 2048
"""So many connections may wait while the API is started again."""


def listen(host: str, port: int) -> socket.socket:
    """A listening socket; port 0 is a free one. Raises OSError."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    return socket.create_server((host, port), family=family, backlog=_BACKLOG)


def is_loopback(host: str) -> bool:
    """Whether `host`, a name or an address, can only mean this machine."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"
