"""Every error answer of the API: `application/problem+json` after RFC 9457."""

from __future__ import annotations

import logging
import re
from collections.abc import Mapping, Sequence
from http import HTTPStatus
from typing import Any, Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import iter_route_contexts
from obstore.exceptions import BaseError
from pydantic import BaseModel
from redis.exceptions import RedisError
from starlette.datastructures import FormData
from starlette.exceptions import HTTPException
from starlette.routing import Match

from gcvec.errors import InputError
from service.described import answer_headers
from worker.problems import Problem, input_problem, problem

logger = logging.getLogger(__name__)

_COME_BACK = {"Retry-After": "5"}
_NAMES: Final = {
    "form": ("form", "part"),
    "body": ("body", "field"),
    "query": ("query", "parameter"),
    "path": ("address", "part"),
    "header": ("header", "header"),
}
"""What to call the places of a request: the whole, and what is in it."""
_SAYINGS: Final = {
    "missing": "is missing",
    "json_invalid": "is not JSON",
    "model_type": "should be a JSON object",
    "model_attributes_type": "should be a JSON object",
    "list_type": "should be a list",
    "string_type": "should be text",
    "int_type": "should be a whole number",
    "int_parsing": "should be a whole number",
    "int_from_float": "should be a whole number",
    "float_type": "should be a number",
    "float_parsing": "should be a number",
}
_LONGEST_NAME: Final = 200
_SHOULD: Final = re.compile(r"\w+ (?=should )")
_UNTOLD_JSON: Final = problem(
    "invalid-request", "the body should be sent as Content-Type: application/json", "/header/content-type"
)
_HEADERS = {
    401: answer_headers("WWW-Authenticate"),
    409: answer_headers("Retry-After", always=False),
    413: answer_headers("Retry-After", always=False),
    416: answer_headers("Content-Range"),
    429: answer_headers("Retry-After", always=False),
    503: answer_headers("Retry-After"),
}
_CODES = {401: "unauthorized", 404: "not-found", 405: "method-not-allowed", 413: "too-large"}


class ProblemView(BaseModel):
    """A problem document (RFC 9457); `pointer` names the offending part of the input."""

    type: str
    title: str
    status: int
    detail: str
    pointer: str | None = None


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The error answers of an endpoint, for the interface description."""
    schema = {"$ref": "#/components/schemas/ProblemView"}
    return {
        status: {
            "description": HTTPStatus(status).phrase,
            "content": {"application/problem+json": {"schema": schema}},
            **({"headers": _HEADERS[status]} if status in _HEADERS else {}),
        }
        for status in statuses
    }


class ProblemError(Exception):
    """An error that ends the request with a problem document."""

    def __init__(
        self, code: str, detail: str, *, pointer: str | None = None, headers: Mapping[str, str] | None = None
    ) -> None:
        super().__init__(detail)
        self.problem = problem(code, detail, pointer)
        self.headers = dict(headers or {})

    @classmethod
    def of(cls, found: Problem) -> ProblemError:
        """An error with a problem that was found elsewhere."""
        error = cls(found.code, found.detail, pointer=found.pointer)
        if found.status == HTTPStatus.SERVICE_UNAVAILABLE:
            error.headers = dict(_COME_BACK)
        return error


def unavailable(detail: str) -> ProblemError:
    """A part of the service is away; the client had better come back in a few seconds."""
    return ProblemError("unavailable", detail, headers=_COME_BACK)


def answer(found: Problem, headers: Mapping[str, str] | None = None) -> JSONResponse:
    """The problem as a response."""
    return JSONResponse(
        found.as_dict(), found.status, dict(headers or {}), media_type="application/problem+json"
    )


def install(app: FastAPI) -> None:
    """Have every error of the application answered with a problem document."""

    @app.exception_handler(ProblemError)
    async def _problem(_: Request, error: ProblemError) -> JSONResponse:
        return answer(error.problem, error.headers)

    @app.exception_handler(InputError)
    async def _input(_: Request, error: InputError) -> JSONResponse:
        return answer(input_problem(error))

    @app.exception_handler(RequestValidationError)
    async def _invalid(_: Request, error: RequestValidationError) -> JSONResponse:
        if isinstance(error.body, bytes):  # which the framework takes for JSON only if it is told so
            return answer(_UNTOLD_JSON)
        first = error.errors()[0]
        where, path = _place(first, error.body)
        detail = explained(first, path, *_NAMES[where])
        pointer = "/".join(("", *([] if where == "form" else [where]), *map(str, path)))
        return answer(problem("invalid-request", detail, pointer))

    @app.exception_handler(HTTPException)
    async def _http(request: Request, error: HTTPException) -> JSONResponse:
        if isinstance(error.__cause__, ProblemError):  # raised while the framework read the body
            return await _problem(request, error.__cause__)
        if isinstance(error.__cause__, MemoryError):  # likewise
            return await _memory(request, error.__cause__)
        if isinstance(error.__cause__, OSError):  # a large body is kept in a file for the time being
            logger.warning("upload: %s", error.__cause__)
            return answer(*_away("the upload cannot be kept: the disk of the service may be full"))
        code = _CODES.get(error.status_code, "invalid-request")
        found = problem(code, str(error.detail))
        headers = {"Allow": _allowed(request)} if code == "method-not-allowed" else error.headers
        return answer(Problem(found.type, found.title, error.status_code, found.detail), headers)

    @app.exception_handler(RedisError)
    async def _broker(_: Request, error: RedisError) -> JSONResponse:
        logger.warning("broker: %s", type(error).__name__)
        return answer(*_away("the job records cannot be reached"))

    @app.exception_handler(BaseError)
    @app.exception_handler(OSError)
    async def _store(_: Request, error: Exception) -> JSONResponse:
        logger.warning("storage: %s", type(error).__name__)
        return answer(*_away("the storage cannot be reached"))

    @app.exception_handler(MemoryError)
    async def _memory(request: Request, _: MemoryError) -> JSONResponse:
        logger.warning("no memory left for %s %s", request.method, request.url.path)
        return answer(*_away("the service has no memory left for this now"))

    @app.exception_handler(Exception)
    async def _unexpected(_: Request, error: Exception) -> JSONResponse:
        logger.error("unexpected error", exc_info=error)
        return answer(problem("internal-error", "the request failed for a reason that was logged"))


def explained(error: Mapping[str, Any], path: Sequence[int | str], whole: str, part: str) -> str:
    """What a validation error says in words for people, of the `whole` or of the `part` of it at `path`."""
    name = "/".join(map(str, path))[:_LONGEST_NAME]
    kind, said = error["type"], error["msg"]
    if kind == "extra_forbidden":
        return f"there is no {part} {name!r}"
    subject = f"the {part} {name!r}" if path else f"the {whole}"
    if kind in _SAYINGS:
        return f"{subject} {_SAYINGS[kind]}"
    if "UploadFile" in said:
        return f"{subject} should be a file"
    if _SHOULD.match(said):
        return f"{subject} {_SHOULD.sub('', said)}"
    return f"{subject}: {said.removeprefix('Value error, ')}"


def _place(error: Mapping[str, Any], body: object) -> tuple[str, list[int | str]]:
    """What a validation error is about: in what of the request, and where in it."""
    where, *path = error["loc"]
    if error["type"] == "json_invalid":
        path = []  # it is a position in the text
    return "form" if isinstance(body, FormData) and where == "body" else where, path


def _allowed(request: Request) -> str:
    """The methods of the address, each of which is a route of its own."""
    methods = {
        method
        for context in iter_route_contexts(request.app.routes)
        if context.original_route.matches(request.scope)[0] is not Match.NONE
        for method in context.methods or ()
    }
    return ", ".join(sorted(methods))


def _away(detail: str) -> tuple[Problem, Mapping[str, str]]:
    error = unavailable(detail)
    return error.problem, error.headers
