"""Union-find against scipy's connected components."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from gcvec.disjoint_sets import united


@settings(max_examples=50)
@given(n=st.integers(1, 30), pairs=st.integers(0, 40), seed=st.integers(0, 1000))
def test_united_things_are_scipys_components(n: int, pairs: int, seed: int) -> None:
    first, second = np.random.default_rng(seed).integers(0, n, (2, pairs))
    graph = coo_array((np.ones(pairs), (first, second)), shape=(n, n))
    np.testing.assert_array_equal(united(first, second, n), connected_components(graph, directed=False)[1])
