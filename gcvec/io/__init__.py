"""Pictures and region annotations in. Light to import: Pillow, numpy and defusedxml, never the solver."""

from gcvec.io.annotations import check_size, read_annotations
from gcvec.io.limits import DEFAULT_LIMITS, Limits
from gcvec.io.picture import Picture, PictureHeader, probe_picture, read_picture

__all__ = [
    "DEFAULT_LIMITS",
    "Limits",
    "Picture",
    "PictureHeader",
    "check_size",
    "probe_picture",
    "read_annotations",
    "read_picture",
]
