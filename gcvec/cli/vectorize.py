"""`gcvec vectorize`: a photo into a .gcv file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from gcvec.cli._files import about, check_outputs, load_picture, warn, write
from gcvec.cli._options import (
    EXISTING_FILE,
    NEW_FILE,
    matte_option,
    picture_argument,
    vectorization_options,
)
from gcvec.cli._progress import progress_bar, quick_interrupt
from gcvec.options import Options

if TYPE_CHECKING:
    from gcvec import Annotations
    from gcvec.io import Picture


@click.command()
@picture_argument
@click.option(
    "-o", "--output", required=True, type=NEW_FILE, metavar="OUT.gcv", help="Where the result goes."
)
@click.option(
    "-a",
    "--annotations",
    type=EXISTING_FILE,
    help="Regions: CVAT for images 1.1 or COCO 1.0. Without it the regions are found automatically.",
)
@click.option(
    "--image-name",
    metavar="NAME",
    help="The picture's name in the annotations; default: the file's own name, else the only one.",
)
@vectorization_options
@matte_option
@click.option("--workers", type=int, default=Options.workers, help="Threads; 0: one a core.")
@click.option("--report", type=NEW_FILE, metavar="R.json", help="Write errors, counts and times here.")
@click.option("--preview", type=NEW_FILE, metavar="P.png", help="Write the vector image, rendered, here.")
def vectorize(
    image: Path,
    output: Path,
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
    check_outputs(output, report, preview, inputs=(image, annotations))
    picture = load_picture(image, matte)
    annotated = _load_regions(annotations, image_name, image.name, picture) if annotations else None

    from gcvec import vectorize

    with about(annotations or image), quick_interrupt(), progress_bar() as on_progress:
        result = vectorize(picture.pixels, annotated, options, on_progress=on_progress)
    warn(annotations or image, result.warnings)
    write(output, result.to_bytes())
    if report and result.report:
        write(report, json.dumps(result.report.as_dict(), indent=2).encode() + b"\n")
    if preview:
        from gcvec.export.png import png

        write(preview, png(result.picture))


def _load_regions(path: Path, image_name: str | None, picture_name: str, picture: Picture) -> Annotations:
    from gcvec.io import check_size, read_annotations

    with about(path):
        annotations = read_annotations(path.read_bytes(), image_name=image_name, picture_name=picture_name)
        height, width = picture.pixels.shape[:2]
        check_size(annotations, width, height)
    return annotations
