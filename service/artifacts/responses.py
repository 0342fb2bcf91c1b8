"""Stored files over HTTP: entity tags, conditional requests and byte ranges (RFC 9110)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

import obstore
from fastapi import Request, Response
from fastapi.responses import RedirectResponse, StreamingResponse
from obstore.store import ObjectStore

from service.compression import LEAST_SIZE, is_compressible, wants_gzip
from service.described import answer_headers
from service.errors import ProblemError
from worker import storage
from worker.storage import StoredFile

_SINGLE_RANGE = re.compile(r"bytes=(\d{0,18})-(\d{0,18})$")


def served(media_type: str, model: Any = None) -> dict[int | str, dict[str, Any]]:
    """The answers of `file_response` to those who may have the file, for the interface description."""
    content: dict[str, Any] = {media_type: {}}
    part = answer_headers("ETag", "Content-Range")
    return {
        200: {"content": content, "model": model, "headers": answer_headers("ETag")},
        206: {"description": "The part asked for", "content": content, "headers": part},
        304: {"description": "The client has it", "headers": answer_headers("ETag")},
    }


async def file_response(
    request: Request,
    store: ObjectStore,
    file: StoredFile,
    media_type: str,
    headers: Mapping[str, str],
    redirect_seconds: int,
) -> Response:
    """The file, the part of it that was asked for, or 304 if the client has it already.

    With `redirect_seconds`, and a store that can be read directly, a redirect to the file there; but scripts
    of pages get the file itself, since neither the page's policy nor the bucket need let them follow.
    """
    etag = f'"{file.sha256}"'
    common = {
        "ETag": etag,
        "Accept-Ranges": "bytes",
        "Cache-Control": "private, no-cache",
        **headers,
    }
    if _lists(request.headers.get("if-none-match"), etag):
        return Response(status_code=304, headers={**common, **_varied(request, etag, media_type, file.size)})
    if (
        redirect_seconds
        and not _by_script(request)
        and (link := storage.direct_link(store, file.path, redirect_seconds))
    ):
        return RedirectResponse(link, 307, {"Cache-Control": "no-store"})
    wanted = _range(request, etag, file.size) if request.method == "GET" else None
    start, stop = wanted or (0, file.size)
    if wanted is not None:
        common["Content-Range"] = f"bytes {start}-{stop - 1}/{file.size}"
    common["Content-Length"] = str(stop - start)
    status = 200 if wanted is None else 206
    if request.method == "HEAD" or start == stop:
        return Response(status_code=status, headers=common, media_type=media_type)
    try:
        found = await obstore.get_async(store, file.path, options={"range": (start, stop)})
    except FileNotFoundError:
        raise ProblemError("gone", "the job has expired or was deleted") from None
    if stop - start < LEAST_SIZE:  # a stream would be compressed however short it is
        return Response(bytes(await found.bytes_async()), status, common, media_type)
    return StreamingResponse(found.stream(), status, common, media_type)


def _varied(request: Request, etag: str, media_type: str, size: int) -> dict[str, str]:
    """What compression would add to the whole file, and an answer without content has to tell as well."""
    if not is_compressible(media_type, size):
        return {}
    varied = {"Vary": "Accept-Encoding"}
    return {**varied, "ETag": f"W/{etag}"} if wants_gzip(request.headers) else varied


def _by_script(request: Request) -> bool:
    """Whether a script of a page asks. Browsers tell only servers on TLS or on their own machine; our page
    says it itself."""
    headers = request.headers
    return headers.get("sec-fetch-mode") == "cors" or "x-requested-with" in headers


def _lists(header: str | None, etag: str) -> bool:
    tags = [] if header is None else [tag.strip().removeprefix("W/") for tag in header.split(",")]
    return etag in tags or "*" in tags


def _range(request: Request, etag: str, size: int) -> tuple[int, int] | None:
    """The bytes wanted, [start, stop); None for all. A header that is not one range of bytes is ignored."""
    if request.headers.get("if-range", etag) != etag:
        return None
    match = _SINGLE_RANGE.match(request.headers.get("range", "").replace(" ", ""))
    if match is None or match.groups() == ("", ""):
        return None
    first, last = match.groups()
    if first == "":
        start, stop = max(0, size - int(last)), size
    else:
        start, stop = int(first), min(size, int(last) + 1 if last else size)
        if last and int(last) < int(first):
            return None
    if start >= size or start >= stop:
        raise ProblemError(
            "range-not-satisfiable",
            f"the file has {size} bytes",
            headers={"Content-Range": f"bytes */{size}"},
        )
    return start, stop
