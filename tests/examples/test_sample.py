"""The sample's regions lie on the edges of its photo."""

from importlib.resources import as_file, files

import numpy as np
from scipy.ndimage import gaussian_gradient_magnitude, map_coordinates
from shapely.geometry import Polygon

from examples.demo import ANNOTATIONS
from gcvec.io import check_size, read_annotations, read_picture

SHARP = {"nostril", "shelf", "temple stripe"} | {
    f"{side} {part}" for side in ("left", "right") for part in ("lid", "iris", "pupil")
}
"""Regions with an edge that stands out from the fur; the others fade or are out of focus."""


def sample() -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """The photo's grey levels and the outline of each region, by label."""
    with as_file(files("skimage") / "data" / "chelsea.png") as photo:
        pixels = read_picture(photo.read_bytes()).pixels
    annotations = read_annotations(ANNOTATIONS.read_bytes(), picture_name="chelsea.png")
    assert annotations.warnings == ()
    check_size(annotations, pixels.shape[1], pixels.shape[0])
    return pixels.mean(axis=2), {shape.label: shape.rings[0] for shape in annotations.shapes}


def test_regions_are_simple_polygons() -> None:
    _, outlines = sample()
    assert len(outlines) >= 15
    for label, outline in outlines.items():
        assert Polygon(outline).is_valid, label
        assert Polygon(outline).area > 20, label


def test_outlines_lie_on_image_edges() -> None:
    grey, outlines = sample()
    gradient = gaussian_gradient_magnitude(grey, 1.0)
    typical = np.median(gradient)
    assert outlines.keys() >= SHARP
    for label in SHARP:
        x, y = outlines[label].T - 0.5
        along = map_coordinates(gradient, [y, x], order=1, mode="nearest")
        assert np.median(along) > 2 * typical, label
