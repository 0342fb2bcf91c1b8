"""`gcvec compare`: how close a .gcv file comes to its photo."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from gcvec.cli._files import about, load_picture, load_vector_image
from gcvec.cli._options import WHITE, Matte

MEASURES = ("mse", "mse_raw", "mae", "psnr", "ssim", "patches", "points", "bytes", "foldovers")


def compare(
    image: Annotated[Path, Argument(exists=True, dir_okay=False, readable=True, help="The photo.")],
    vector_image: Annotated[
        Path, Argument(metavar="OUT.gcv", exists=True, dir_okay=False, readable=True, help="A vector image.")
    ],
    as_json: Annotated[bool, Option("--json", help="Print JSON.")] = False,
    matte: Matte = WHITE,
) -> None:
    """Measure a vector image against its photo."""
    from gcvec.metrics import compare

    picture = load_picture(image, matte)
    vector = load_vector_image(vector_image)
    with about(vector_image):
        measured = compare(picture.pixels, vector, vector_image.stat().st_size).as_dict()
    measures = {name: measured[name] for name in MEASURES}
    if as_json:
        print(json.dumps(measures))
        return
    for name, value in measures.items():
        print(f"{name:<10}{value:>12.4f}" if isinstance(value, float) else f"{name:<10}{value:>12}")
