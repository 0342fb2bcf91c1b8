"""Middleware: what browsers may do with the answers of the service."""

from __future__ import annotations

from http import HTTPStatus
from typing import Final

from fastapi import FastAPI, Response
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service import compression
from service.errors import answer
from worker.problems import problem
from worker.settings import Settings

_DATA: Final = "default-src 'none'; frame-ancestors 'none'"
_DRAWING: Final = f"{_DATA}; img-src data:; style-src 'unsafe-inline'; sandbox"
_PAGE: Final = (
    "default-src 'self'; img-src 'self' blob: data:; "
    "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'"
)
_POLICIES: Final = {"text/html": _PAGE, "image/svg+xml": _DRAWING}

_ASKED_WITH: Final = [
    "Authorization",
    "Content-Type",
    "Idempotency-Key",
    "If-None-Match",
    "If-Range",
    "Last-Event-ID",
    "Range",
    "X-Requested-With",
]
_READABLE: Final = ["Location", "Retry-After", "ETag", "Content-Range", "Content-Disposition"]


def install(app: FastAPI, settings: Settings) -> None:
    """Compress answers, let pages of `cors_origins` read them, and head off what else browsers could do."""
    compression.install(app)
    if settings.cors_origins:
        app.add_middleware(
            OtherOrigins,
            allow_origins=settings.cors_origins,
            allow_methods=["GET", "HEAD", "POST", "DELETE"],
            allow_headers=_ASKED_WITH,
            expose_headers=_READABLE,
            max_age=3600,
        )
    app.add_middleware(SafeHeaders)


class OtherOrigins(CORSMiddleware):
    """Lets pages of other origins in. One that may not do what it asks for gets an error like all others."""

    def preflight_response(self, request_headers: Headers) -> Response:
        response = super().preflight_response(request_headers)
        if response.status_code == HTTPStatus.OK:
            return response
        refused = bytes(response.body).decode().removeprefix("Disallowed CORS ")
        return answer(
            problem("forbidden", f"not allowed to pages of other origins: {refused}"), {"Vary": "Origin"}
        )


class SafeHeaders:
    """Types are not guessed, answers not framed, scripts our own; a drawing opened by itself is inert."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def headed(message: Message) -> None:
            if message["type"] == "http.response.start":
                _complete(MutableHeaders(scope=message), message["status"])
            await send(message)

        await self._app(scope, receive, headed if scope["type"] == "http" else send)


def _complete(headers: MutableHeaders, status: int) -> None:
    if status != HTTPStatus.NOT_MODIFIED:  # which would replace the policy of what the browser keeps
        media_type = headers.get("content-type", "").partition(";")[0]
        headers.setdefault("Content-Security-Policy", _POLICIES.get(media_type, _DATA))
    headers.setdefault("X-Content-Type-Options", "nosniff")
    headers.setdefault("Referrer-Policy", "no-referrer")
    headers.setdefault("Cross-Origin-Resource-Policy", "same-origin")
    if "content-encoding" in headers and "etag" in headers:  # the tag is of the content as it is stored
        headers["ETag"] = f"W/{headers['etag'].removeprefix('W/')}"
