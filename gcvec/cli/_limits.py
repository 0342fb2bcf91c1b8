"""The limits on pictures and annotations, from the same variables as those of the service."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING

from gcvec.errors import InputError

if TYPE_CHECKING:
    from gcvec.io import Limits

VARIABLES = {
    "max_pixels": "GCVEC_MAX_PIXELS",
    "max_side": "GCVEC_MAX_SIDE",
    "max_polygons": "GCVEC_MAX_POLYGONS",
    "max_vertices_per_polygon": "GCVEC_MAX_POLYGON_VERTICES",
    "max_vertices": "GCVEC_MAX_VERTICES",
    "annotation_bytes": "GCVEC_MAX_UPLOAD_BYTES",
}


def limits() -> Limits:
    """The limits in force. Raises InputError naming the variable that is wrong."""
    from gcvec.io import Limits

    return Limits(
        **{name: _positive(variable) for name, variable in VARIABLES.items() if variable in os.environ}
    )


def _positive(variable: str) -> int:
    text = os.environ[variable]
    try:
        value = int(text)
    except ValueError:
        value = 0
    if value < 1:
        raise InputError(f"{variable}: must be a whole number above 0, not {text!r}", code="bad-option")
    return value
