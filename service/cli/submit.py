"""`gcvec submit`: a picture through a running service."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click
from httpx import HTTPError

from gcvec.cli._options import EXISTING_FILE, picture_argument, vectorization_options
from gcvec.cli._progress import progress_bar
from service.client import Client, problem_error
from worker.artifacts import EXPORTS, KINDS


@click.command()
@picture_argument
@click.option("--url", required=True, help="Where the service runs, e.g. http://127.0.0.1:8000.")
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Where the files go.",
)
@click.option("-a", "--annotations", type=EXISTING_FILE, help="CVAT XML or COCO JSON.")
@click.option("--image-name", metavar="NAME", help="The picture's name in a file that annotates several.")
@vectorization_options
@click.option(
    "--matte",
    metavar="#RRGGBB",
    help="What transparent pixels are laid over; default: what the service says.",
)
@click.option("--key", envvar="GCVEC_API_KEY", show_envvar=True, help="API key, if the service asks.")
def submit(
    image: Path, url: str, output: Path, annotations: Path | None, key: str | None, **options: Any
) -> None:
    """Upload a picture to a service, watch the job and download its files."""
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
