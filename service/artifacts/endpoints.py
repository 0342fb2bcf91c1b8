"""The files of a finished job and of its revisions."""

from __future__ import annotations

from typing import Annotated, Any, Final

from fastapi import APIRouter, Depends, Query, Request, Response

from service.artifacts.description import Description
from service.artifacts.responses import file_response, served
from service.artifacts.service import Result, derived_file, original, revised
from service.deps import ServicesDep
from service.described import answer_headers
from service.errors import ProblemError, documented
from worker.artifacts import EXPORTS, KINDS, REVISED, Kind
from worker.settings import Settings
from worker.storage import StoredFile

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])

SUMMARIES: Final = {
    "result": "The patch description",
    "gcv": "The vector image, compact",
    "preview": "The vector image, drawn",
    "error": "Where the drawing differs from the picture",
    "patches": "Outlines, polygon vertices and control points over the drawing",
    "report": "Counts, errors, times and warnings",
    "svg": "The vector image as SVG: outlines are vector, shading is sampled",
    "pdf": "The vector image as PDF: one Gouraud shading",
    "glb": "The vector image as glTF: one unlit mesh",
}
_MODELS: Final[dict[str, Any]] = {"result": Description}

Scale = Annotated[float, Query(ge=0.01, le=32, description="drawn pixels a pixel of the picture")]


def _serve(name: str, kind: Kind, dependency: Any, prefix: str) -> None:
    """Register the address of one kind of file."""

    async def stored(request: Request, services: ServicesDep, result: Result = dependency) -> Response:
        return await _respond(request, services, result, result.manifest.files[name], kind)

    async def drawn(
        request: Request, services: ServicesDep, result: Result = dependency, scale: Scale = 1.0
    ) -> Response:
        scale = round(scale, 2)
        if scale == 1:
            return await stored(request, services, result)
        _check_size(result, scale, services.settings)
        file = await derived_file(services, result, f"preview-{scale:g}.png", "preview", scale)
        return await _respond(request, services, result, file, kind)

    async def exported(request: Request, services: ServicesDep, result: Result = dependency) -> Response:
        file = await derived_file(services, result, kind.filename, name, 1.0)
        return await _respond(request, services, result, file, kind)

    endpoint: Any = drawn if name == "preview" else exported if name in EXPORTS else stored
    path = f"{prefix}/{kind.route}"
    router.add_api_route(path, endpoint, methods=["HEAD"], include_in_schema=False)
    router.add_api_route(
        path,
        endpoint,
        name=f"get_{'revision_' if prefix else ''}{name}",
        summary=SUMMARIES[name],
        response_class=Response,
        responses={
            **served(kind.media_type, _MODELS.get(name)),
            307: {
                "description": "It is to be had from the store directly",
                "headers": answer_headers("Location"),
            },
            **documented(401, 403, 404, 409, 410, 413, 416, 422, 429, 500, 503),
        },
    )


async def _respond(
    request: Request, services: ServicesDep, result: Result, file: StoredFile, kind: Kind
) -> Response:
    revision = f"-{result.revision}" if result.revision else ""
    disposition = f'inline; filename="{result.job.id}{revision}-{kind.filename}"'
    headers = {"Content-Disposition": disposition}
    redirect = services.settings.redirect_seconds
    return await file_response(request, services.store, file, kind.media_type, headers, redirect)


def _check_size(result: Result, scale: float, settings: Settings) -> None:
    width, height = (result.job.request[side] * scale for side in ("width", "height"))
    if width * height > settings.max_pixels or max(width, height) > settings.max_side:
        raise ProblemError(
            "invalid-request",
            f"at this scale the picture would have {width:.0f} x {height:.0f} pixels",
            pointer="/query/scale",
        )


for _name, _kind in (KINDS | EXPORTS).items():
    _serve(_name, _kind, Depends(original), "")
    if _name in REVISED or _name in EXPORTS:
        _serve(_name, _kind, Depends(revised), "/revisions/{revision}")
