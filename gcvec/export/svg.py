"""SVG: one path a patch, with its exact Bézier outline, filled with a raster of the patch's own colours.

SVG has no gradient that could express the colours of a patch: outlines are vector, shading is sampled. The
same patches lie beneath once more, with a thin stroke, so that no background shows between neighbours.
"""

from __future__ import annotations

from base64 import b64encode
from io import BytesIO
from xml.sax.saxutils import quoteattr

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from gcvec.curves import bspline
from gcvec.export.patch_rasters import PatchRaster, patch_rasters
from gcvec.plain_text import plain_text
from gcvec.vector_image import VectorImage

Ints = NDArray[np.int64]

DIGITS = 2
"""Decimals of coordinates, pixels."""

STROKE = 0.8
"""Width of the stroke beneath, pixels."""

JPEG_QUALITY = 96


def svg(image: VectorImage) -> bytes:
    """An SVG file of the picture, one user unit a pixel."""
    width, height = image.width, image.height
    beziers = _beziers(image)
    patches = [
        _patch(k, image.labels[k], "".join(_loop(loop, beziers) for loop in image.network.loops[k]), samples)
        for k, samples in enumerate(patch_rasters(image))
    ]
    beneath = "".join(
        f'<use xlink:href="#patch{k}" stroke="url(#colors{k})"/>\n' for k in range(len(patches))
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" \
width="{width}" height="{height}" viewBox="0 0 {width} {height}">
<title>Vector image of {len(patches)} patches</title>
<desc>Generalized Coons patches, written by gcvec. The outlines are exact Bézier curves. \
The shading is sampled: SVG cannot express it.</desc>
<g fill-rule="evenodd">
<g stroke-width="{STROKE}" stroke-linejoin="round">
{beneath}</g>
{"".join(patches)}</g>
</svg>
""".encode()


def _patch(number: int, label: str, outline: str, samples: PatchRaster) -> str:
    height, width = (f"{n * samples.step:g}" for n in samples.samples.shape[:2])
    size = f'width="{width}" height="{height}"'
    # Only xlink:href: every reader knows it, some know nothing else, and data in both would double the file.
    return (
        f'<pattern id="colors{number}" patternUnits="userSpaceOnUse"'
        f' x="{samples.x:g}" y="{samples.y:g}" {size}>'
        f'<image {size} preserveAspectRatio="none" xlink:href="{_data_url(samples.samples)}"/></pattern>\n'
        f'<path id="patch{number}" data-label={quoteattr(plain_text(label))}'
        f' fill="url(#colors{number})" d="{outline}"/>\n'
    )


def _data_url(samples: NDArray[np.uint8]) -> str:
    jpeg, png = BytesIO(), BytesIO()
    Image.fromarray(samples).save(jpeg, "JPEG", quality=JPEG_QUALITY, subsampling=0, optimize=True)
    Image.fromarray(samples).save(png, "PNG")
    kind, file = min(("jpeg", jpeg), ("png", png), key=lambda choice: choice[1].tell())
    return f"data:image/{kind};base64,{b64encode(file.getvalue()).decode()}"


def _beziers(image: VectorImage) -> list[Ints]:
    """Bézier control points `(m, 4, 2)` of every curve, in units of the last decimal."""
    offsets, control_points = image.foundation.samples.offsets, image.foundation.control_points
    exact = [
        bspline.bezier(control_points[offsets[c] : offsets[c + 1]], curve.closed)
        for c, curve in enumerate(image.network.curves)
    ]
    return [np.rint(points * 10**DIGITS).astype(np.int64) for points in exact]


def _loop(loop: tuple[tuple[int, bool], ...], beziers: list[Ints]) -> str:
    """A closed subpath in relative coordinates: differences of rounded ones, so that no error adds up."""
    segments = np.concatenate([beziers[c] if forward else beziers[c][::-1, ::-1] for c, forward in loop])
    path = "M" + _numbers(segments[0, 0])
    before = "M"
    for segment in segments:
        steps = segment[1:] - segment[0]
        command, numbers = ("l", steps[2]) if _is_line(steps) else ("c", steps.ravel())
        text = _numbers(numbers)
        if command != before:
            path += command
        elif not text.startswith("-"):
            path += " "
        path += text
        before = command
    return path + "z"


def _is_line(steps: Ints) -> bool:
    """Whether a segment is straight and never turns back."""
    end = steps[2]
    across = steps[:2, 0] * end[1] - steps[:2, 1] * end[0]
    along = steps @ end
    return bool((across == 0).all() and 0 <= along[0] <= along[1] <= along[2])


def _numbers(values: Ints) -> str:
    """Shortest decimals, apart by a space where no sign tells them apart."""
    return " ".join(map(_number, values.tolist())).replace(" -", "-")


def _number(value: int) -> str:
    text = f"{value / 10**DIGITS:.{DIGITS}f}".rstrip("0").rstrip(".")
    return "-" + text[2:] if text.startswith("-0.") else text[1:] if text.startswith("0.") else text
