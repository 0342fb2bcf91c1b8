"""Keeps a handful of child processes running, and takes all of them down with itself."""

from __future__ import annotations

import logging
import os
import signal
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import Final

from worker.process import die_with

logger = logging.getLogger(__name__)

_LOOK_SECONDS: Final = 0.2
_FIRST_PAUSE: Final = 0.5
_LONGEST_PAUSE: Final = 10.0
_STEADY_SECONDS: Final = 30.0


@dataclass(frozen=True)
class Command:
    """A child: what to run, with what on its standard input, and how it is asked to end."""

    name: str
    arguments: Sequence[str]
    environment: Mapping[str, str] = field(default_factory=dict)
    stdin: bytes | None = None
    inherited: tuple[int, ...] = ()
    stop_signal: signal.Signals = signal.SIGTERM
    stop_seconds: float = 10.0


class Child:
    """A running command, started again with growing pauses when it ends by itself."""

    def __init__(self, command: Command) -> None:
        self.command = command
        self._pause = _FIRST_PAUSE
        self._restart_at: float | None = None
        self._start()

    def _start(self) -> None:
        command = self.command
        self._started = time.monotonic()
        self._restart_at = None
        self._process = subprocess.Popen(
            command.arguments,
            env={**os.environ, **command.environment},
            stdin=subprocess.DEVNULL if command.stdin is None else subprocess.PIPE,
            stdout=subprocess.DEVNULL,  # what children have to say goes to stderr or a log
            pass_fds=command.inherited,
            start_new_session=True,
            preexec_fn=partial(die_with, os.getpid()),
        )
        if command.stdin is not None and self._process.stdin is not None:
            self._process.stdin.write(command.stdin)
            self._process.stdin.close()

    def look_after(self) -> None:
        """Start the command again if it has ended and its pause is over."""
        now = time.monotonic()
        code = self._process.poll()
        if code is None:
            return
        if self._restart_at is None:
            self._pause = _FIRST_PAUSE if now - self._started > _STEADY_SECONDS else self._pause
            logger.warning("%s ended (%s), starting it again", self.command.name, code)
            self._restart_at = now + self._pause
            self._pause = min(2 * self._pause, _LONGEST_PAUSE)
        elif now >= self._restart_at:
            self._start()

    def ask_to_stop(self) -> None:
        """Ask the child to end."""
        logger.info("stopping %s", self.command.name)
        if self._process.poll() is None:
            self._process.send_signal(self.command.stop_signal)

    def stop(self) -> None:
        """Wait until the child that was asked to end has done so, and end it if it does not."""
        try:
            self._process.wait(self.command.stop_seconds)
        except subprocess.TimeoutExpired:
            logger.warning("%s does not end, killing it", self.command.name)
            self._process.kill()
            self._process.wait()


class Supervisor:
    """Children in layers, each of which needs the earlier ones; they are stopped in the opposite order.

    Must live in the main thread: the kernel ends the children with the thread that started them.
    """

    def __init__(self) -> None:
        self._layers: list[list[Child]] = []
        self._stopping = False

    def __enter__(self) -> Supervisor:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, self._stop)
        return self

    def __exit__(self, *_: object) -> None:
        for layer in reversed(self._layers):
            for child in layer:
                child.ask_to_stop()
            for child in layer:
                child.stop()

    @property
    def stopping(self) -> bool:
        """Whether a signal has asked us to end."""
        return self._stopping

    def start(self, *commands: Command) -> None:
        """Start a layer of children."""
        self._layers.append([])
        for command in commands:
            self._layers[-1].append(Child(command))

    def look_after(self) -> None:
        """Look at every child once, then rest a moment."""
        for child in chain.from_iterable(self._layers):
            child.look_after()
        time.sleep(_LOOK_SECONDS)

    def _stop(self, *_: object) -> None:
        self._stopping = True
