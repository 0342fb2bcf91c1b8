"""Middleware: answers are compressed where that is wanted and saves something."""

from __future__ import annotations

import re
from typing import Final

from fastapi import FastAPI
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.gzip import DEFAULT_EXCLUDED_CONTENT_TYPES, GZipMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LEAST_SIZE: Final = 1024
"""Bytes from which on it is worth it."""

_COMPACT: Final = (
    *DEFAULT_EXCLUDED_CONTENT_TYPES,
    "application/octet-stream",
    "application/pdf",
    "application/vnd.gcvec",
)
"""What is compressed as it is, uploaded pictures among it: to do so again costs time and their length."""

_NO_WEIGHT: Final = re.compile(r"q\s*=\s*0(\.0*)?")


def install(app: FastAPI) -> None:
    """Compress the answers of the application."""
    app.add_middleware(
        GZipMiddleware, minimum_size=LEAST_SIZE, compresslevel=6, exclude_content_types=_COMPACT
    )
    app.add_middleware(CompressedHeads)
    app.add_middleware(AcceptedEncodings)


class AcceptedEncodings:
    """Tells the compression, which reads no weights, only of a gzip that is wanted: `gzip;q=0` is none."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http":
            stated = ",".join(Headers(scope=scope).getlist("accept-encoding"))
            others = [field for field in scope["headers"] if field[0] != b"accept-encoding"]
            accepted = b"gzip" if _accepts_gzip(stated) else b"identity"
            scope = {**scope, "headers": [*others, (b"accept-encoding", accepted)]}
        await self._app(scope, receive, send)


class CompressedHeads:
    """Gives an answer to HEAD, whose content nobody compresses, the headers of the one to GET (RFC 9110,
    9.3.2)."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def headed(message: Message) -> None:
            if message["type"] == "http.response.start":
                _complete(MutableHeaders(scope=message), wants_gzip(Headers(scope=scope)))
            await send(message)

        is_head = scope["type"] == "http" and scope["method"] == "HEAD"
        await self._app(scope, receive, headed if is_head else send)


def _complete(headers: MutableHeaders, gzip: bool) -> None:
    media_type, size = headers.get("content-type", ""), int(headers.get("content-length", 0))
    if "content-encoding" in headers or not is_compressible(media_type, size):
        return
    headers.add_vary_header("Accept-Encoding")
    if gzip:
        headers["Content-Encoding"] = "gzip"
        del headers["Content-Length"]  # which nobody knows before it is compressed


def is_compressible(media_type: str, size: int) -> bool:
    """Whether so many bytes of this type are compressed for those who want it."""
    kind = media_type.partition(";")[0].strip().lower()
    return size >= LEAST_SIZE and not {kind, f"{kind.partition('/')[0]}/*"} & set(_COMPACT)


def wants_gzip(headers: Headers) -> bool:
    """Whether a request, behind `AcceptedEncodings`, wants its answer compressed."""
    return headers.get("accept-encoding") == "gzip"


def _accepts_gzip(stated: str) -> bool:
    """Whether a list of encodings has gzip, or all, with a weight above zero (RFC 9110, 12.5.3)."""
    weights: dict[str, bool] = {}
    for entry in stated.lower().split(","):
        coding, *parameters = (part.strip() for part in entry.split(";"))
        weights[coding] = not any(_NO_WEIGHT.fullmatch(parameter) for parameter in parameters)
    return weights.get("gzip", weights.get("x-gzip", weights.get("*", False)))
