"""`gcvec vectorize`: a photo into a .gcv file."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcvec.cli._files import (
    STANDARD_STREAM,
    about,
    check_files,
    load_picture,
    read,
    vector_image_file,
    warn,
    write,
)
from gcvec.cli._limits import limits
from gcvec.cli._options import (
    OUTPUT_FILE,
    annotations_option,
    ignored_options,
    image_name_option,
    matte_option,
    picture_argument,
    vector_image_output_option,
    vectorization_options,
)
from gcvec.cli._progress import progress_bar, quick_interrupt
from gcvec.errors import InputError
from gcvec.options import Options

if TYPE_CHECKING:
    from gcvec import Annotations


def _ends_in_png(_context: click.Context, _parameter: click.Parameter, path: Path | None) -> Path | None:
    if path and path != STANDARD_STREAM and path.suffix.lower() != ".png":
        raise click.BadParameter(f"{path}: the ending must be .png")
    return path


@click.command()
@picture_argument
@vector_image_output_option
@annotations_option
@image_name_option
@vectorization_options
@matte_option
@click.option("--workers", type=int, default=Options.workers, help="Threads; 0: one a core.")
@click.option(
    "--report",
    type=OUTPUT_FILE,
    metavar="R.json",
    help="Write errors, counts, times and warnings here; - for stdout.",
)
@click.option(
    "--preview",
    type=OUTPUT_FILE,
    callback=_ends_in_png,
    metavar="P.png",
    help="Write the vector image, rendered, here; - for stdout.",
)
def vectorize(
    image: Path,
    output: str,
    annotations: Path | None,
    image_name: str | None,
    matte: str,
    report: Path | None,
    preview: Path | None,
    **settings: Any,
) -> None:
    """Turn a photo and its regions into a vector image."""
    if image_name and not annotations:
        raise click.BadParameter("needs --annotations", param_hint="'--image-name'")
    options = Options(**settings)
    target = vector_image_file(output, image)
    check_files(inputs=(image, annotations), outputs=(target, report, preview))
    ignored = ignored_options(settings, annotations)
    warn(image, ignored)
    picture = load_picture(image, matte)
    annotated = _load_regions(annotations, image_name, image) if annotations else None

    from gcvec import vectorize
    from gcvec.allocation import give_back_large_arrays

    give_back_large_arrays()
    with _about_what(image, annotations), quick_interrupt(), progress_bar() as on_progress:
        result = vectorize(picture.pixels, annotated, options, on_progress=on_progress)
    warn(annotations or image, result.region_warnings)
    warn(image, result.result_warnings)
    write(target, result.to_bytes())
    if report and result.report:
        warnings = [*ignored, *picture.warnings, *result.warnings]
        content = {**result.report.as_dict(), "warnings": warnings}
        write(report, json.dumps(content, indent=2).encode() + b"\n")
    if preview:
        from gcvec.export.png import png

        write(preview, png(result.picture))


@contextmanager
def _about_what(image: Path, annotations: Path | None) -> Iterator[None]:
    """Name the picture in an InputError about an option raised inside, the annotations in any other."""
    try:
        yield
    except InputError as error:
        with about(image if error.code == "bad-option" else annotations or image):
            raise


def _load_regions(path: Path, image_name: str | None, picture: Path) -> Annotations:
    from gcvec.io import read_annotations

    bounds = limits()
    picture_name = str(picture if picture == STANDARD_STREAM else os.path.abspath(picture))
    with about(path):
        return read_annotations(read(path), image_name=image_name, picture_name=picture_name, limits=bounds)
