"""`gcvec vectorize`: a photo into a .gcv file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, Option

from gcvec.cli._files import about, load_picture, require_folder, warn, write
from gcvec.cli._options import (
    WHITE,
    Effort,
    Matte,
    MaxPoints,
    Regions,
    Snap,
    Strategy,
    TargetBytes,
    TargetMse,
)
from gcvec.cli._progress import no_garbage_collection, progress_bar, quick_interrupt
from gcvec.options import Options

if TYPE_CHECKING:
    from gcvec import Annotations
    from gcvec.io import Picture


def vectorize(
    image: Annotated[
        Path, Argument(exists=True, dir_okay=False, readable=True, help="A PNG, JPEG, WebP or TIFF picture.")
    ],
    output: Annotated[Path, Option("-o", "--output", metavar="OUT.gcv", help="Where the result goes.")],
    annotations: Annotated[
        Path | None,
        Option(
            "-a",
            "--annotations",
            exists=True,
            dir_okay=False,
            readable=True,
            help="Regions: CVAT for images 1.1 or COCO 1.0. Without it the regions are found automatically.",
        ),
    ] = None,
    image_name: Annotated[
        str | None,
        Option(
            metavar="NAME",
            help="The picture's name in the annotations; default: the file's own name, else the only one.",
        ),
    ] = None,
    regions: Regions = Options.regions,
    snap: Snap = Options.snap,
    effort: Effort = Options.effort,
    target_bytes: TargetBytes = Options.target_bytes,
    strategy: Strategy = Options.strategy,
    target_mse: TargetMse = Options.target_mse,
    max_points: MaxPoints = Options.max_points,
    matte: Matte = WHITE,
    workers: Annotated[int, Option(help="Threads; 0: one a core.")] = Options.workers,
    report: Annotated[
        Path | None, Option(metavar="R.json", help="Write errors, counts and times here.")
    ] = None,
    preview: Annotated[
        Path | None, Option(metavar="P.png", help="Write the vector image, rendered, here.")
    ] = None,
) -> None:
    """Turn a photo and its regions into a vector image."""
    options = Options(
        strategy=strategy,
        target_mse=target_mse,
        max_points=max_points,
        workers=workers,
        regions=regions,
        snap=snap,
        effort=effort,
        target_bytes=target_bytes,
    )
    require_folder(output, report, preview)
    with no_garbage_collection():
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
