"""`gcvec compare`: how close a .gcv file comes to its photo."""

from __future__ import annotations

import json
from pathlib import Path

import click

from gcvec.cli._files import (
    STANDARD_STREAM,
    about,
    check_files,
    load_picture,
    load_vector_image,
    read,
    write,
)
from gcvec.cli._options import INPUT_FILE, matte_option, picture_argument

MEASURES = ("mse", "mse_raw", "mae", "psnr", "ssim", "patches", "points", "bytes", "foldovers")


@click.command()
@picture_argument
@click.argument("vector_image", type=INPUT_FILE, metavar="OUT.gcv", help="A vector image; - for stdin.")
@click.option("--json", "as_json", is_flag=True, help="Print JSON.")
@matte_option
def compare(image: Path, vector_image: Path, as_json: bool, matte: str) -> None:
    """Measure a vector image against its photo."""
    from gcvec.metrics import compare

    check_files(inputs=(image, vector_image))
    picture = load_picture(image, matte)
    data = read(vector_image)
    vector = load_vector_image(data, vector_image)
    with about(vector_image):
        measured = compare(picture.pixels, vector, len(data)).as_dict()
    measures = {name: measured[name] for name in MEASURES}
    lines = [
        f"{name:<10}{value:>12.4f}" if isinstance(value, float) else f"{name:<10}{value:>12}"
        for name, value in measures.items()
    ]
    told = json.dumps(measures) if as_json else "\n".join(lines)
    write(STANDARD_STREAM, f"{told}\n".encode())
