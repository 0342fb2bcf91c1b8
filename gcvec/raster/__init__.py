"""Triangles → pixels: which triangles cover which pixels, and the pictures that come of it."""

from gcvec.raster.painting import paint, sample, triangle_at_pixel_centres

__all__ = ["paint", "sample", "triangle_at_pixel_centres"]
