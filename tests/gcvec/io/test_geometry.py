"""Rings of coordinates, however far away they lie."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec import Annotations, InputError, Options, Shape, vectorize
from gcvec.io.geometry import ring_from


@pytest.mark.parametrize("far", [1e8, 1e20, 1.7e308])
def test_a_vertex_far_away_cuts_the_picture_where_it_should(far: float) -> None:
    """A triangle that holds all of the picture below the diagonal, and one that lies outside."""
    pixels = np.full((40, 60, 3), 90, np.uint8)
    pixels[20:] = 200
    below = ring_from([-far, 20, far, 20, 0, far], "polygon 1")
    beyond = ring_from([far, 0, far, far, far / 2, 0], "polygon 2")
    image = vectorize(
        pixels,
        Annotations((Shape("below", rings=(below,)), Shape("beyond", rings=(beyond,)))),
        Options(target_mse=5),
    )
    assert [label for label in image.labels if label == "below"] == ["below"]
    assert "beyond" not in image.labels
    assert any("outside" in warning for warning in image.warnings)
    assert np.abs(image.render().astype(int) - pixels).max() <= 4


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf"), "1e999"])
def test_what_is_not_finite_is_refused(value: object) -> None:
    with pytest.raises(InputError, match="not finite"):
        ring_from([0, value, 1, 1, 2, 0], "polygon 1")
