"""Middleware: lets a request in, on its headers alone, before any of its body is read."""

from __future__ import annotations

import logging
import math
import re
from typing import Any, Final
from urllib.parse import SplitResult, urlsplit

from fastapi import FastAPI
from redis.exceptions import RedisError
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from service.access.keys import ANYONE, KeyRing
from service.errors import ProblemError, answer, unavailable
from service.sockets import is_loopback
from worker.settings import Settings

logger = logging.getLogger(__name__)

_PAGE: Final = re.compile(r"/v1/jobs/[^/]+/view")
_KEY_NEEDED: Final = {"WWW-Authenticate": "Bearer"}


class Gate:
    """Finds out whose request it is, for `get_owner`, and refuses those that nobody may make.

    The page of a job needs no key: it holds nothing, and asks for the job with the key that its tab keeps.
    Without keys the service is open to this machine alone: to connections that arrive on a loopback address,
    for a name of the loopback, and from no page of another site.
    """

    def __init__(self, app: ASGIApp, settings: Settings, state_of: FastAPI) -> None:
        self._app = app
        self._keys = KeyRing(settings.api_keys)
        self._guarded = ("/v1",) if settings.metrics_open else ("/v1", "/metrics")
        self._origins = settings.cors_origins
        self._state_of = state_of

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or not self._guards(scope):
            await self._app(scope, receive, send)
            return
        try:
            scope.setdefault("state", {})["owner"] = await self._admit(scope)
        except ProblemError as error:
            await answer(error.problem, error.headers)(scope, receive, send)
        else:
            await self._app(scope, receive, send)

    def _guards(self, scope: Scope) -> bool:
        path: str = scope["path"].removeprefix(scope.get("root_path", ""))
        return path.startswith(self._guarded) and not _PAGE.fullmatch(path)

    async def _admit(self, scope: Scope) -> str:
        headers = Headers(scope=scope)
        if self._keys:
            owner = self._owner(headers)
        else:
            self._check_local(scope, headers)
            owner = ANYONE
        try:
            seconds = await self._state_of.state.services.rates.take(owner)
        except RedisError as error:
            logger.warning("broker: %s", type(error).__name__)
            raise unavailable("the job records cannot be reached") from error
        if seconds > 0:
            again = {"Retry-After": str(math.ceil(seconds))}
            raise ProblemError("too-many-requests", "this key asks too often", headers=again)
        return owner

    def _owner(self, headers: Headers) -> str:
        scheme, _, key = headers.get("authorization", "").partition(" ")
        owner = self._keys.owner(key.strip()) if scheme.lower() == "bearer" else None
        if owner is None:
            raise ProblemError("unauthorized", "send Authorization: Bearer KEY", headers=_KEY_NEEDED)
        return owner

    def _check_local(self, scope: Scope, headers: Headers) -> None:
        server: Any = scope.get("server") or ("", None)
        host, origin = headers.get("host", ""), headers.get("origin")
        if not is_loopback(server[0]) or not is_loopback(_parts(f"//{host}").hostname or ""):
            raise ProblemError("forbidden", "without API keys the service is open on loopback only")
        if origin is not None and _parts(origin).netloc != host and origin not in self._origins:
            raise ProblemError("forbidden", "pages of other sites may not use the service")


def _parts(address: str) -> SplitResult:
    """The parts of an address; none of one that cannot be read, which is then nobody's."""
    try:
        return urlsplit(address)
    except ValueError:
        return urlsplit("")
