"""The files of a finished job."""

from __future__ import annotations

from fastapi import APIRouter, Request, Response

from service.artifacts.responses import file_response
from service.artifacts.service import stored_file
from service.deps import JobDep, ServicesDep
from worker.artifacts import KINDS, Kind

router = APIRouter(prefix="/v1/jobs/{job_id}", tags=["results"])


def _serve(name: str, kind: Kind, summary: str) -> None:
    async def endpoint(request: Request, job: JobDep, services: ServicesDep) -> Response:
        file = await stored_file(services, job, name)
        disposition = f'inline; filename="{job.id}-{kind.filename}"'
        headers = {"Content-Disposition": disposition}
        return await file_response(request, services.store, file, kind.media_type, headers)

    router.add_api_route(f"/{kind.route}", endpoint, methods=["HEAD"], include_in_schema=False)
    router.add_api_route(
        f"/{kind.route}",
        endpoint,
        name=f"get_{name}",
        summary=summary,
        response_class=Response,
        responses={200: {"content": {kind.media_type: {}}}, 206: {}, 304: {}},
    )


_serve("result", KINDS["result"], "The patch description")
_serve("gcv", KINDS["gcv"], "The vector image, compact")
_serve("preview", KINDS["preview"], "The vector image, drawn")
_serve("error", KINDS["error"], "Where the drawing differs from the picture")
_serve("patches", KINDS["patches"], "Outlines, polygon vertices and control points over the drawing")
_serve("report", KINDS["report"], "Counts, errors and times")
