"""The pages of the web client, and the uploaded picture that they compare with."""

from __future__ import annotations

from http import HTTPStatus
from pathlib import Path
from typing import Final

import obstore
from fastapi import APIRouter, Request, Response
from fastapi.staticfiles import StaticFiles

from service.artifacts.responses import file_response, served
from service.deps import JobDep, ServicesDep
from service.errors import ProblemError, documented
from worker import storage
from worker.storage import StoredFile

STATIC: Final = Path(__file__).parents[1] / "static"

_HEADERS: Final = {"Cache-Control": "no-cache"}
"""Pages, scripts and styles belong together, so browsers ask whether theirs are still those."""

PAGES: Final = {"/": "index.html", "/docs": "docs.html", "/v1/jobs/{job_id}/view": "view.html"}
"""The upload form, all calls, and a job: each asks for what it shows itself."""

SWAGGER_UI: Final = ("swagger-ui-bundle.js", "swagger-ui.css")
"""What `docs.html` loads of Swagger UI, from a package that holds its files as they are published."""

router = APIRouter()


def _serve(folder: StaticFiles, path: str, address: str) -> None:
    """Register the address of one file. All of them behind "/" would hide which methods others know."""

    async def static(request: Request) -> Response:
        response = await folder.get_response(path, request.scope)
        response.headers.update(_HEADERS)
        response.headers["ETag"] = f"W/{response.headers['etag']}"  # of its time and size, compressed or not
        if response.status_code == HTTPStatus.NOT_MODIFIED:  # which compression does not see to
            response.headers["Vary"] = "Accept-Encoding"
        return response

    router.add_route(address, static, include_in_schema=False)


@router.head("/v1/jobs/{job_id}/image", include_in_schema=False)
@router.get(
    "/v1/jobs/{job_id}/image",
    response_class=Response,
    responses={
        **served("application/octet-stream"),
        **documented(401, 403, 404, 410, 416, 422, 429, 503),
    },
    summary="The uploaded picture",
    tags=["jobs"],
)
async def get_image(request: Request, job: JobDep, services: ServicesDep) -> Response:
    """The picture as it was uploaded."""
    path = storage.image_path(job.id)
    try:
        found = await obstore.head_async(services.store, path)
    except FileNotFoundError:
        raise ProblemError("gone", "the job has expired or was deleted") from None
    digest = job.request.get("sha256") or job.id  # which earlier records lack; a job has one picture for ever
    file = StoredFile(path, found["size"], digest)
    headers = {"Content-Disposition": "attachment", "X-Content-Type-Options": "nosniff"}
    return await file_response(request, services.store, file, "application/octet-stream", headers, 0)


_own = StaticFiles(directory=STATIC)
for _address, _page in PAGES.items():
    _serve(_own, _page, _address)
for _file in STATIC.rglob("*.*"):
    _path = _file.relative_to(STATIC).as_posix()
    _serve(_own, _path, f"/{_path}")

_swagger_ui = StaticFiles(packages=[("fastapi_standalone_docs", "static/swagger")])
for _name in SWAGGER_UI:
    _serve(_swagger_ui, _name, f"/swagger-ui/{_name}")
