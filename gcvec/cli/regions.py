"""`gcvec regions`: the automatic regions of a photo, as annotations."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcvec.cli._files import about, check_files, load_picture, write
from gcvec.cli._limits import limits
from gcvec.cli._options import OUTPUT_FILE, matte_option, picture_argument

if TYPE_CHECKING:
    from gcvec.io import Limits
    from gcvec.regions.partition import Partition


@click.command()
@picture_argument
@click.option(
    "-o",
    "--output",
    required=True,
    type=OUTPUT_FILE,
    metavar="REGIONS",
    help="Its ending says what is written: .xml (CVAT for images 1.1) or .json (COCO 1.0).",
)
@click.option(
    "--regions",
    "count",
    type=click.IntRange(min=0),
    default=0,
    metavar="N",
    help="How many regions; 0: those that vectorize finds, $GCVEC_MAX_POLYGONS (2000) at most.",
)
@matte_option
def regions(image: Path, output: Path, count: int, matte: str) -> None:
    """Divide a photo into regions along its edges, to correct by hand and pass to vectorize -a."""
    check_files(inputs=(image,), outputs=(output,))
    document = DOCUMENTS.get(output.suffix.lower())
    if document is None:
        known = ", ".join(DOCUMENTS)
        raise click.BadParameter(f"{output}: the ending must be one of {known}", param_hint="'-o'")
    picture = load_picture(image, matte)

    from gcvec.automatic_regions import automatic_regions
    from gcvec.options import Options

    bounds = limits()
    found = automatic_regions(picture.pixels, Options(regions=count))
    if not count and len(found.names) > bounds.max_polygons:
        found = automatic_regions(picture.pixels, Options(regions=bounds.max_polygons))
    with about(output):
        content = document(found, image.name, bounds)
    write(output, content)


def _cvat(partition: Partition, image_name: str, bounds: Limits) -> bytes:
    from gcvec.io import write_cvat_xml

    return write_cvat_xml(partition, image_name, bounds)


def _coco(partition: Partition, image_name: str, bounds: Limits) -> bytes:
    from gcvec.io import write_coco

    return write_coco(partition, image_name, bounds)


DOCUMENTS: dict[str, Callable[[Partition, str, Limits], bytes]] = {".xml": _cvat, ".json": _coco}
