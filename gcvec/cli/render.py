"""`gcvec render`: a .gcv file as a picture or a document."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcvec.cli._files import check_files, load_vector_image, read, write
from gcvec.cli._options import INPUT_FILE, OUTPUT_FILE

if TYPE_CHECKING:
    from gcvec import VectorImage

MAX_PIXELS = 2**28
"""The largest picture drawn, a guard against a mistyped scale: 16,384 px square, 800 MB of pixels."""


@click.command()
@click.argument("vector_image", type=INPUT_FILE, metavar="OUT.gcv", help="A vector image; - for stdin.")
@click.option(
    "-o",
    "--output",
    required=True,
    type=OUTPUT_FILE,
    metavar="PICTURE",
    help="Its ending says what is written: .png, .svg, .pdf, .glb, .json.",
)
@click.option("--scale", type=float, default=1.0, help="PNG pixels a pixel of the photo.")
@click.option(
    "--raw", is_flag=True, help="Sample at pixel centres instead of averaging over each pixel (PNG)."
)
def render(vector_image: Path, output: Path, scale: float, raw: bool) -> None:
    """Draw a vector image at any scale, or write it in another format."""
    check_files(inputs=(vector_image,), outputs=(output,))
    ending = output.suffix.lower()
    if ending not in DOCUMENTS and ending != ".png":
        known = ", ".join((".png", *DOCUMENTS))
        raise click.BadParameter(f"{output}: the ending must be one of {known}", param_hint="'-o'")
    if not scale > 0:
        raise click.BadParameter(f"must be above 0, not {scale:g}", param_hint="'--scale'")
    if ending in DOCUMENTS and (raw or scale != 1):
        raise click.BadParameter(f"{output}: --scale and --raw are for PNG", param_hint="'-o'")
    image = load_vector_image(read(vector_image), vector_image)
    write(output, DOCUMENTS[ending](image) if ending in DOCUMENTS else _png(image, scale, raw))


def _png(image: VectorImage, scale: float, raw: bool) -> bytes:
    from gcvec.export.png import png

    width, height = image.width * scale, image.height * scale
    if width * height > MAX_PIXELS:
        raise click.BadParameter(f"{width:.10g} x {height:.10g} pixels are too many", param_hint="'--scale'")
    return png(image.render(scale, raw=raw))


def _svg(image: VectorImage) -> bytes:
    from gcvec.export.svg import svg

    return svg(image)


def _pdf(image: VectorImage) -> bytes:
    from gcvec.export.pdf import pdf

    return pdf(image)


def _glb(image: VectorImage) -> bytes:
    from gcvec.export.glb import glb

    return glb(image)


def _json(image: VectorImage) -> bytes:
    return json.dumps(image.description(), separators=(",", ":"), allow_nan=False).encode() + b"\n"


DOCUMENTS: dict[str, Callable[[VectorImage], bytes]] = {
    ".svg": _svg,
    ".pdf": _pdf,
    ".glb": _glb,
    ".json": _json,
}
