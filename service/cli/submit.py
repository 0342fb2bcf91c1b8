"""`gcvec submit`: a picture through a running service."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

import click
from httpx import URL, HTTPError, InvalidURL

from gcvec.cli._files import STANDARD_STREAM, check_files, read, warn, write
from gcvec.cli._limits import limits
from gcvec.cli._options import (
    annotations_option,
    checked_matte,
    ignored_options,
    image_name_option,
    picture_argument,
    vectorization_options,
)
from gcvec.cli._progress import progress_bar
from gcvec.errors import FailureError, InputError
from gcvec.options import without_effect
from service.client import Client, NamedFile, problem_error
from worker.artifacts import EXPORTS, KINDS

_KEY_VARIABLE: Final = "GCVEC_API_KEY"


def _checked(_context: click.Context, _parameter: click.Parameter, url: str) -> str:
    """The address of a service. Raises click.BadParameter if nobody could be called there."""
    try:
        parts = URL(url)
    except InvalidURL as error:
        raise click.BadParameter(f"{url!r}: {error}") from None
    if parts.scheme not in ("http", "https") or not parts.host:
        raise click.BadParameter(f"{url!r} is no address such as http://127.0.0.1:8000")
    return url


def _checked_key(_context: click.Context, _parameter: click.Parameter, key: str | None) -> str | None:
    """The key without blanks around it. Raises click.BadParameter, which does not repeat it."""
    key = key and key.strip()
    if key and not (key.isascii() and key.isprintable()):
        raise click.BadParameter("an API key has no such characters")
    return key


@contextmanager
def _naming(image: Path, annotations: Path | None, url: str, key: str | None) -> Iterator[None]:
    """Let an error raised inside name the file or the option, or else the address, that it is about."""
    try:
        yield
    except InputError as error:
        place = error.pointer or "/"
        if error.code == "unauthorized":
            why = "does not know this API key" if key else "asks for an API key"
            said = f"{url}: the service {why}: --key or {_KEY_VARIABLE}"
            raise InputError(said, code=error.code) from error
        if place.startswith("/options/"):
            raise InputError(str(error), code=error.code) from error
        if place == "/image":
            raise InputError(f"{image}: {error}", code=error.code) from error
        # A place that is no path of the request's is one in the annotations.
        if annotations is not None and (place == "/annotations" or not place.startswith("/")):
            pointer = None if place.startswith("/") else place
            raise InputError(f"{annotations}: {error}", code=error.code, pointer=pointer) from error
        raise InputError(f"{url}: {error}", code=error.code, pointer=error.pointer) from error
    except (HTTPError, FailureError) as error:
        raise FailureError(f"{url}: {error}") from error


def _image_name(image: Path, annotations: bytes) -> str | None:
    """What the annotations call a picture that they tell from others by its folders, which are not sent.

    None where its own name will do, and where nothing does: what is wrong the service says.
    """
    from gcvec.io import image_name_for

    if image == STANDARD_STREAM:
        return None
    with suppress(InputError):
        return image_name_for(annotations, os.path.abspath(image), limits())
    return None


@contextmanager
def _found_again_at(place: str) -> Iterator[None]:
    """Let Ctrl-C inside say where the job is, which goes on."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"gcvec: interrupted; the job is at {place}", file=sys.stderr)
        raise


@click.command()
@picture_argument
@click.option(
    "--url", required=True, callback=_checked, help="Where the service runs, e.g. http://127.0.0.1:8000."
)
@click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(file_okay=False, path_type=Path),
    metavar="DIR",
    help="Where the files go.",
)
@annotations_option
@image_name_option
@vectorization_options
@click.option(
    "--matte",
    metavar="#RRGGBB",
    callback=checked_matte,
    help="What transparent pixels are laid over; default: what the service says.",
)
@click.option(
    "--key",
    envvar=_KEY_VARIABLE,
    show_envvar=True,
    callback=_checked_key,
    help="API key, if the service asks.",
)
def submit(
    image: Path, url: str, output: Path, annotations: Path | None, key: str | None, **options: Any
) -> None:
    """Upload a picture to a service, watch the job and download its files."""
    output.mkdir(parents=True, exist_ok=True)
    files = {name: output / kind.filename for name, kind in (KINDS | EXPORTS).items()}
    check_files(inputs=(image, annotations), outputs=tuple(files.values()))
    warn(image, ignored_options(options, annotations))
    photo = NamedFile(image.name, read(image))
    regions = None if annotations is None else NamedFile(annotations.name, read(annotations))
    if regions is not None and options["image_name"] is None:
        options["image_name"] = _image_name(image, regions.content)
    with Client(url, key) as client:
        with _naming(image, annotations, url, key):
            job = client.submit(photo, regions, options)
        place = f"{url.rstrip('/')}{job['links']['self']}"
        with _naming(image, annotations, place, key), _found_again_at(place):
            with progress_bar() as on_progress:
                job = client.follow(job, on_progress)
            if job["status"] != "succeeded":
                raise problem_error(job["error"] or {"status": 500, "detail": f"the job was {job['status']}"})
            told = without_effect(options, annotations is not None).values()
            warn(image, (warning for warning in job["warnings"] if warning not in told))
            for name, path in files.items():
                write(path, client.download(job["links"][name]))
