"""Where control points have room, against distances that shapely measures."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.refinement.clearance import CLEARANCE, find_clear_pixels
from tests.gcvec.scenes import SCENES, clear_of_edges, foundation_of


@pytest.mark.parametrize("scene", SCENES)
def test_pixels_with_room_keep_their_distance_from_edges(scene: str) -> None:
    foundation = foundation_of(scene)
    np.testing.assert_array_equal(find_clear_pixels(foundation), clear_of_edges(foundation, CLEARANCE))
