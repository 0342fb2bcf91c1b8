"""`gcvec submit`: a picture through a running service."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from httpx import HTTPError
from typer import Argument, Option

from gcvec.cli._options import Effort, MaxPoints, Regions, Snap, Strategy, TargetBytes, TargetMse
from gcvec.cli._progress import progress_bar
from gcvec.options import Options
from service.client import Client, problem_error
from worker.artifacts import EXPORTS, KINDS


def submit(
    image: Annotated[
        Path, Argument(exists=True, dir_okay=False, readable=True, help="A PNG, JPEG, WebP or TIFF picture.")
    ],
    url: Annotated[str, Option(help="Where the service runs, e.g. http://127.0.0.1:8000.")],
    output: Annotated[
        Path, Option("-o", "--output", metavar="DIR", file_okay=False, help="Where the files go.")
    ],
    annotations: Annotated[
        Path | None,
        Option(
            "-a", "--annotations", exists=True, dir_okay=False, readable=True, help="CVAT XML or COCO JSON."
        ),
    ] = None,
    image_name: Annotated[
        str | None, Option(metavar="NAME", help="The picture's name in a file that annotates several.")
    ] = None,
    regions: Regions = Options.regions,
    snap: Snap = Options.snap,
    effort: Effort = Options.effort,
    target_bytes: TargetBytes = Options.target_bytes,
    strategy: Strategy = Options.strategy,
    target_mse: TargetMse = Options.target_mse,
    max_points: MaxPoints = Options.max_points,
    matte: Annotated[
        str | None,
        Option(
            metavar="#RRGGBB", help="What transparent pixels are laid over; default: what the service says."
        ),
    ] = None,
    key: Annotated[str | None, Option(envvar="GCVEC_API_KEY", help="API key, if the service asks.")] = None,
) -> None:
    """Upload a picture to a service, watch the job and download its files."""
    options = {
        "image_name": image_name,
        "regions": regions,
        "snap": snap,
        "effort": effort,
        "target_bytes": target_bytes,
        "strategy": strategy,
        "target_mse": target_mse,
        "max_points": max_points,
        "matte": matte,
    }
    output.mkdir(parents=True, exist_ok=True)
    try:
        with Client(url, key) as client:
            job = client.submit(image, annotations, options)
            with progress_bar() as on_progress:
                job = client.follow(job, on_progress)
            if job["status"] != "succeeded":
                raise problem_error(job["error"] or {"status": 500, "detail": f"the job was {job['status']}"})
            for warning in job["warnings"]:
                print(f"gcvec: warning: {image}: {warning}", file=sys.stderr)
            for name, kind in (KINDS | EXPORTS).items():
                client.download(job["links"][name], output / kind.filename)
    except HTTPError as error:
        raise RuntimeError(f"{url}: {error}") from error
