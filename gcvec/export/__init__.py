"""Vector images out: pictures of them, and files for other programs."""

from gcvec.export.pictures import error_map, patch_overlay

__all__ = ["error_map", "patch_overlay"]
