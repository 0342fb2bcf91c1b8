"""From a vector image and the changes asked for to the files of a new revision."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from gcvec import VectorImage
from gcvec.edit import Move, Recolor, edit, hex_color
from gcvec.errors import InputError
from gcvec.export import patch_overlay
from gcvec.export.png import png
from worker.artifacts import KINDS, REVISED


def edited(image: VectorImage, changes: Mapping[str, Any]) -> VectorImage:
    """The image with control points moved and patches recoloured.

    Raises gcvec.InputError, also where that changes nothing.
    """
    moves = [Move(**move) for move in changes["moves"]]
    recolors = [Recolor(change["patch"], hex_color(change["color"])) for change in changes["recolors"]]
    try:
        result = edit(image, moves, recolors)
    except InputError as error:
        raise InputError(str(error), code=error.code, pointer=f"/body/{error.pointer}") from error
    if _is_same(image, result):
        raise InputError("the edit changes nothing", code="invalid-request", pointer="/body")
    return result


def _is_same(image: VectorImage, other: VectorImage) -> bool:
    """Whether two images that differ by an edit at most have all control points and colours in common."""
    pairs = (
        (image.foundation.control_points, other.foundation.control_points),
        (image.hard, other.hard),
        (image.boundary_colors, other.boundary_colors),
        (image.point_colors, other.point_colors),
    )
    return all(np.array_equal(before, after) for before, after in pairs)


def revision_files(image: VectorImage) -> dict[str, tuple[str, bytes]]:
    """Artefact name -> file name and content, all of the image as its file holds it."""
    encoded = image.to_bytes()
    image = VectorImage.from_bytes(encoded)
    contents = {
        "gcv": encoded,
        "result": json.dumps(image.description()).encode(),
        "preview": png(image.picture),
        "patches": png(patch_overlay(image)),
    }
    return {name: (KINDS[name].filename, contents[name]) for name in REVISED}
