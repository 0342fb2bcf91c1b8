"""Uploads: bounded while they stream in, and looked at as far as is cheap before a job is made of them."""

from __future__ import annotations

import asyncio
import json
import time
from collections import Counter
from dataclasses import dataclass
from typing import Any, Final, NoReturn

from fastapi import Request, UploadFile
from pydantic import ValidationError
from python_multipart.multipart import parse_options_header
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gcvec.errors import InputError, pointing_at
from gcvec.io import PictureHeader, check_size, probe_picture, read_annotations
from service.errors import ProblemError, answer, explained, unavailable
from service.jobs.schemas import JobOptions, Webhook
from worker.settings import Settings, limits
from worker.webhooks import UnsafeTargetError, check_target

_PARTS: Final = ("image", "annotations", "options", "webhook")
_FORM_OVERHEAD: Final = 1_000_000
_LARGEST_HELD: Final = 8
"""As much as so many of the largest uploads is held at a time."""
_LEAST_PACE: Final = 500
"""Bytes a second that a body has to come at, less than the slowest of mobile phones sends."""
_PATIENCE_SECONDS: Final = 60.0
"""A body may be so far behind that pace."""
_CHARSETS: Final = (b"utf-8", b"utf8", b"us-ascii")


@dataclass(frozen=True)
class Upload:
    """What a client sent to make a job of."""

    image: bytes
    picture_name: str | None
    annotations: bytes | None
    options: JobOptions
    webhook: Webhook | None = None


class Pace:
    """How long the next piece of a body is waited for: who dribbles would hold a connection for ever.

    What came quickly is no excuse for later: nobody gets more than the patience that all begin with.
    """

    def __init__(self) -> None:
        self._left = _PATIENCE_SECONDS

    async def keep(self, receive: Receive) -> Message:
        """The next message. Raises ProblemError where it does not come in time."""
        since = time.monotonic()
        try:
            async with asyncio.timeout(self._left):
                message = await receive()
        except TimeoutError:
            raise _too_slow() from None
        gained = len(message.get("body", b"")) / _LEAST_PACE
        self._left = min(self._left - (time.monotonic() - since) + gained, _PATIENCE_SECONDS)
        return message


class LimitBody:
    """Middleware: a request body may not grow beyond what the largest valid upload needs.

    Nor may it come too slowly. Nor may all that are being read or handled: a crowd of large ones would take
    all memory. Nor may a form name a character set other than UTF-8: Python decodes some of them, "punycode"
    for one, in a time that grows with the square of the length.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self._app = app
        self._limit = 2 * settings.max_upload_bytes + _FORM_OVERHEAD
        self._held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        seen, whole, pace = 0, False, Pace()

        async def counted() -> Message:
            nonlocal seen, whole
            message = await (receive() if whole else pace.keep(receive))  # what follows tells of who leaves
            whole = not message.get("more_body", False)
            size = len(message.get("body", b""))
            seen += size
            self._held += size
            if seen > self._limit:
                raise _too_large(self._limit)
            if self._held > _LARGEST_HELD * self._limit:
                raise unavailable("too much is being uploaded at a time")
            return message

        headers = dict(scope["headers"])
        stated = headers.get(b"content-length", b"0")
        if stated.isdigit() and int(stated) > self._limit:
            await answer(_too_large(self._limit).problem)(scope, receive, send)
            return
        if not all(_is_utf8(value) for name, value in scope["headers"] if name == b"content-type"):
            await answer(_FOREIGN_CHARSET.problem)(scope, receive, send)
            return
        try:
            await self._app(scope, counted, send)
        finally:
            self._held -= seen


_FOREIGN_CHARSET: Final = ProblemError(
    "invalid-request", "a form must be in UTF-8", pointer="/header/content-type"
)


def _is_utf8(content_type: bytes) -> bool:
    """Whether a form of this type is read as UTF-8; other bodies are not decoded by what their type says."""
    media_type, options = parse_options_header(content_type)
    return media_type != b"multipart/form-data" or options.get(b"charset", b"utf-8").lower() in _CHARSETS


async def check_parts(request: Request) -> None:
    """Raise ProblemError for an unknown part or one sent twice: what is meant is not ours to guess."""
    form = await request.form()
    for name, count in Counter(name for name, _ in form.multi_items()).items():
        shown, pointer = repr(name[:100]), f"/{name[:100]}"
        if name not in _PARTS:
            detail = f"there is no part {shown}: the parts are {', '.join(_PARTS)}"
            raise ProblemError("invalid-request", detail, pointer=pointer)
        if count > 1:
            raise ProblemError("invalid-request", f"the part {shown} was sent {count} times", pointer=pointer)


def name_of(file: UploadFile) -> str | None:
    """The name of the client's file, in which a form writes a quotation mark as %22 (HTML, 4.10.21.8)."""
    return (file.filename or "").replace("%22", '"') or None


async def read_file(file: UploadFile, name: str, settings: Settings) -> bytes:
    """The content of an uploaded file. Raises ProblemError if it is larger than the limit."""
    data = await file.read(settings.max_upload_bytes + 1)
    if len(data) > settings.max_upload_bytes:
        raise _too_large(settings.max_upload_bytes, name)
    return data


def read_options(text: str | None) -> JobOptions:
    """The options in a JSON object. Raises ProblemError or InputError pointing at the one that is wrong."""
    try:
        options = JobOptions.model_validate(json.loads(text or "{}", parse_constant=_refuse))
    except ValidationError as error:
        first = error.errors()[0]
        pointer = "/".join(("/options", *map(str, first["loc"])))
        detail = explained(first, first["loc"], "options", "option")
        raise ProblemError("bad-option", detail, pointer=pointer) from None
    except (ValueError, RecursionError) as error:
        raise ProblemError(
            "bad-option", f"options is not a JSON object: {error}", pointer="/options"
        ) from None
    try:
        options.to_engine()
    except InputError as error:
        raise InputError(str(error), code=error.code, pointer=f"/options/{error.pointer}") from None
    return options


def read_webhook(text: str | None, settings: Settings) -> Webhook | None:
    """The webhook in a JSON object. Raises ProblemError pointing at what is wrong with it."""
    if text is None:
        return None
    try:
        webhook = Webhook.model_validate_json(text)
        check_target(webhook.url, private=settings.webhook_private)
    except ValidationError as error:
        first = error.errors()[0]
        pointer = "/".join(("/webhook", *map(str, first["loc"])))
        detail = explained(first, first["loc"], "webhook", "field")
        raise ProblemError("bad-webhook", detail, pointer=pointer) from None
    except UnsafeTargetError as error:
        raise ProblemError("bad-webhook", str(error), pointer="/webhook/url") from None
    return webhook


def check(upload: Upload, settings: Settings) -> PictureHeader:
    """The picture's header. Raises InputError for what is unusable as far as can be seen without decoding."""
    bounds = limits(settings)
    with pointing_at("/image"):
        header = probe_picture(upload.image, limits=bounds)
    if upload.annotations is None:
        return header
    with pointing_at("/annotations"):
        annotations = read_annotations(
            upload.annotations,
            image_name=upload.options.image_name,
            picture_name=upload.picture_name,
            limits=bounds,
        )
        check_size(annotations, header.width, header.height)
    return header


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is not a number")


def _too_large(limit: int, part: str | None = None) -> ProblemError:
    what = "the request" if part is None else f"the part {part!r}"
    pointer = None if part is None else f"/{part}"
    return ProblemError("too-large", f"{what} is larger than {limit / 1e6:g} MB", pointer=pointer)


def _too_slow() -> ProblemError:
    detail = f"the request came at less than {_LEAST_PACE} bytes a second for {_PATIENCE_SECONDS:g} s"
    return ProblemError("too-slow", detail, headers={"Connection": "close"})


def request_of(upload: Upload) -> dict[str, Any]:
    """What the upload asks for besides its files."""
    return {
        "picture_name": upload.picture_name,
        "image_name": upload.options.image_name,
        "annotations": upload.annotations is not None,
        "matte": upload.options.matte,
        "options": upload.options.model_dump(exclude={"image_name", "matte"}),
    }
