"""The API as a process of its own: ``python -m service.server 0.0.0.0:8000``."""

from __future__ import annotations

import asyncio
import gc
import socket
import sys
from typing import Final

import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from gcvec.errors import InputError
from service.sockets import listen
from worker import logs, storage
from worker.settings import get_settings

MOST_HEADER_BYTES: Final = 64_000
"""Request line and headers together."""
HEADER_SECONDS: Final = 60
"""So long after a connection was made, or the first byte of a further request, its headers may take."""
STOP_SECONDS: Final = 5
"""So long after the signal to stop a request may still take."""
KEEP_ALIVE_SECONDS: Final = 75
"""Longer than clients pause between two looks at a job, and than proxies keep a connection that is idle."""


class BoundedHttp(HttpToolsProtocol):
    """uvicorn's fast HTTP, which by itself reads headers without end, and waits for them for ever."""

    _head: int | None = None  # bytes of a request whose headers have not all come, in pieces after its first
    _began = False  # whether a request did in the piece of data at hand
    _deadline: asyncio.TimerHandle | None = None  # while headers are awaited

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn does
        super().connection_made(transport)
        self._await_headers()

    def connection_lost(self, exc: Exception | None) -> None:
        self._have_headers()
        super().connection_lost(exc)

    def on_message_begin(self) -> None:
        super().on_message_begin()
        self._head, self._began = 0, True

    def on_headers_complete(self) -> None:
        self._head = None
        self._have_headers()
        if len(self.url) + sum(len(name) + len(value) for name, value in self.headers) > MOST_HEADER_BYTES:
            raise ValueError("headers too large")  # which the parser makes a 400 of
        super().on_headers_complete()

    def data_received(self, data: bytes) -> None:
        self._began = False
        super().data_received(data)
        if self._head is not None and not self._began:
            self._head += len(data)
            if self._head > MOST_HEADER_BYTES and not self.transport.is_closing():
                self.send_400_response("Headers too large.")
        if self.cycle is None or self.cycle.response_complete:
            self._await_headers()

    def _await_headers(self) -> None:
        if self._deadline is None and not self.transport.is_closing():
            self._deadline = self.loop.call_later(HEADER_SECONDS, self.transport.close)

    def _have_headers(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None


class Server(uvicorn.Server):
    """Tells the application first when it is to stop: it sends away in good order those who only wait."""

    def __init__(self, app: FastAPI) -> None:
        super().__init__(configuration(app))
        self._state = app.state

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._state.services.changes.stop()
        await super().shutdown(sockets)


def configuration(app: FastAPI) -> uvicorn.Config:
    """How the application is served. Its records go where all others go."""
    return uvicorn.Config(
        app,
        http=BoundedHttp,
        ws="none",
        log_config=None,
        log_level="warning",
        access_log=False,
        timeout_graceful_shutdown=STOP_SECONDS,
        timeout_keep_alive=KEEP_ALIVE_SECONDS,
    )


def main() -> None:
    """Serve on HOST:PORT, or on the inherited listening socket whose descriptor is the only argument."""
    try:
        logs.start(get_settings())
        storage.require_folder(get_settings())
    except InputError as error:
        print(f"gcvec: {error}", file=sys.stderr)
        sys.exit(2)
    from service.app import create_app  # whose modules need settings that are right

    server = Server(create_app())
    server.config.load()
    gc.collect()
    gc.freeze()  # what is loaded stays: to look through it again takes 0.2 s, and everybody waits
    server.run(sockets=[_listener(sys.argv[1])])


def _listener(place: str) -> socket.socket:
    if place.isdigit():
        return socket.socket(fileno=int(place))
    host, _, port = place.rpartition(":")
    return listen(host.strip("[]"), int(port))


if __name__ == "__main__":
    main()
