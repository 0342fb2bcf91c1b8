"""Areas and weights of triangles, by determinants."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from gcvec.raster.triangle import barycentric, barycentric_at, double_area, double_areas

COORDINATE = st.floats(-100, 100)
POINT = st.tuples(COORDINATE, COORDINATE)


@given(corners=st.tuples(POINT, POINT, POINT).map(np.array), at=POINT)
def test_areas_and_weights_are_those_of_determinants(corners: np.ndarray, at: tuple[float, float]) -> None:
    homogeneous = np.column_stack([corners, np.ones(3)])
    area = double_area(corners, 0, 1, 2)
    np.testing.assert_allclose(area, np.linalg.det(homogeneous), atol=1e-9)
    assert double_areas(corners, np.array([[0, 1, 2], [1, 0, 2]])).tolist()[0] == area
    assume(abs(area) > 1)
    weights = barycentric(corners, 0, 1, 2, *at)
    np.testing.assert_allclose(np.array(weights) @ homogeneous, [*at, 1], rtol=1e-6, atol=1e-6)
    assert barycentric_at(corners, np.array([[0, 1, 2]]), np.array([at])).tolist() == [list(weights)]


def test_areas_are_positive_from_x_to_y() -> None:
    assert double_area(np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]]), 0, 1, 2) == 6.0
