"""Pictures and region annotations in, regions out.

Light to import: Pillow, numpy and defusedxml, never the solver.
"""

from gcvec.annotations import check_size
from gcvec.io.annotations import image_name_for, read_annotations
from gcvec.io.limits import DEFAULT_LIMITS, Limits
from gcvec.io.picture import Picture, PictureHeader, probe_picture, read_picture
from gcvec.io.write_coco import write_coco
from gcvec.io.write_cvat import write_cvat_xml

__all__ = [
    "DEFAULT_LIMITS",
    "Limits",
    "Picture",
    "PictureHeader",
    "check_size",
    "image_name_for",
    "probe_picture",
    "read_annotations",
    "read_picture",
    "write_coco",
    "write_cvat_xml",
]
