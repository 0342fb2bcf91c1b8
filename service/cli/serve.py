"""`gcvec serve`: API, workers and, unless one is named, a broker, in one command."""

from __future__ import annotations

import fcntl
import os
import signal
import socket
import sys
import time
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from textwrap import fill
from typing import Final
from urllib.error import URLError

import click

from gcvec.errors import FailureError, InputError
from gcvec.parallel import cores
from service.broker import private_broker, wait_until_ready
from service.sockets import is_loopback, listen
from service.supervisor import Command, Supervisor
from worker import logs, storage
from worker.queues import HOOKS_QUEUE, JOBS_QUEUE, SHORT_QUEUE
from worker.settings import Settings, get_settings, listing

_READY_SECONDS: Final = 60.0


def _epilog() -> str:
    """What the help page ends with: the settings, each from the start of a line."""
    settings = [fill(line, 78, subsequent_indent="    ") for line in listing().splitlines()]
    # The backspace keeps click from running the lines into one another.
    return "\n".join(("Settings, read from the environment:", "", "\b", *settings))


@click.command(epilog=_epilog())
@click.option("--host", default="127.0.0.1", help="Address to listen on.")
@click.option("--port", type=click.IntRange(0, 65535), default=8000, help="Port to listen on; 0: a free one.")
@click.option("--workers", type=click.IntRange(min=0), default=0, help="Jobs at a time; 0: one a core.")
@click.option(
    "--data",
    envvar="GCVEC_DATA_DIR",
    type=click.Path(file_okay=False, path_type=Path),
    default="gcvec-data",
    help="Folder for files and queue.",
)
def serve(host: str, port: int, workers: int, data: Path) -> None:
    """Run the whole service until interrupted: API, workers and a private broker.

    With GCVEC_BROKER_URL set, that server is used and none is started.
    """
    settings = get_settings().model_copy(update={"data_dir": data})
    logs.start(settings)
    _check_open(settings, host)
    storage.require_folder(settings)
    data.mkdir(parents=True, exist_ok=True)
    processes = workers or cores()
    with _locked(data), closing(_listen(host, port)) as listener, Supervisor() as supervisor:
        environment = {"GCVEC_DATA_DIR": str(data.absolute()), "GCVEC_STORAGE_URL": settings.storage}
        if "GCVEC_BROKER_URL" not in os.environ:
            broker = private_broker(data / "broker")
            supervisor.start(broker.command)
            environment["GCVEC_BROKER_URL"] = broker.url
            if processes == 1:  # nobody could help it
                environment["GCVEC_FAN_OUT_MEGAPIXELS"] = os.environ.get("GCVEC_FAN_OUT_MEGAPIXELS", "0")
            if not wait_until_ready(broker.url, _READY_SECONDS):
                raise FailureError("the private broker does not start")
        supervisor.start(*_commands(environment, listener, processes))
        _announce(supervisor, listener)
        while not supervisor.stopping:
            supervisor.look_after()


def _check_open(settings: Settings, host: str) -> None:
    """Say so if the service asks for no key. Raises InputError if more than this machine could reach it."""
    if settings.api_keys:
        return
    if not is_loopback(host):
        raise InputError(
            f"{host} is not a loopback address: set GCVEC_API_KEYS before others can reach the service",
            code="bad-option",
        )
    print("gcvec: no API keys are set: open to every program on this machine", file=sys.stderr)


def _commands(environment: Mapping[str, str], listener: socket.socket, workers: int) -> tuple[Command, ...]:
    handle = listener.fileno()
    api = (sys.executable, "-m", "service.server", str(handle))
    return (
        Command("API", api, environment, inherited=(handle,)),
        _worker("worker", JOBS_QUEUE, workers, environment),
        _worker("short", SHORT_QUEUE, 1, environment),
        _worker("webhooks", HOOKS_QUEUE, 8, environment, "--pool", "threads"),
    )


def _worker(name: str, queue: str, processes: int, environment: Mapping[str, str], *more: str) -> Command:
    """A Celery worker for one queue."""
    command = ("-m", "celery", "-A", "worker.app", "--quiet", "worker", "--loglevel", "INFO")
    place = ("--queues", queue, "--hostname", f"{name}@%h", "--concurrency", str(processes))
    fleet = ("--without-gossip", "--without-mingle", "--without-heartbeat")
    return Command(
        name,
        (sys.executable, *command, *place, *fleet, *more),
        environment,
        stop_signal=signal.SIGQUIT,
        stop_seconds=20.0,
    )


def _listen(host: str, port: int) -> socket.socket:
    """The listening socket. The API inherits it, so that connections wait while the API is started again."""
    try:
        return listen(host, port)
    except OSError as error:
        raise InputError(f"cannot listen on {host}:{port}: {error.strerror}", code="bad-option") from error


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold a data folder for one service at a time. Raises InputError if another has it."""
    with (folder / "lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{folder}: another service uses this folder", code="bad-option") from None
        yield


def _announce(supervisor: Supervisor, listener: socket.socket) -> None:
    """Print the address once the service answers."""
    host, port = listener.getsockname()[:2]
    url = f"http://[{host}]:{port}" if ":" in host else f"http://{host}:{port}"
    directly = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    deadline = time.monotonic() + _READY_SECONDS
    while not supervisor.stopping and time.monotonic() < deadline:
        try:
            with directly.open(f"{url}/readyz", timeout=2):
                print(f"gcvec serves {url}", flush=True)
                return
        except (URLError, OSError):
            supervisor.look_after()
    if not supervisor.stopping:
        raise FailureError("the API does not start")
