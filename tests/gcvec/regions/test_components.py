from __future__ import annotations

from collections import Counter

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from gcvec.regions.components import absorb_slivers, bridge_slivers, connected_components

owner_maps = arrays(np.int32, st.tuples(st.integers(1, 14), st.integers(1, 14)), elements=st.integers(0, 3))


def flooded(owners: NDArray[np.int32]) -> NDArray[np.int32]:
    """Components by flood fill, one pixel at a time, in raster order."""
    labels = np.full(owners.shape, -1, dtype=np.int32)
    count = 0
    for start in np.ndindex(owners.shape):
        if labels[start] >= 0:
            continue
        stack = [start]
        while stack:
            y, x = stack.pop()
            if labels[y, x] >= 0:
                continue
            labels[y, x] = count
            for v, u in ((y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)):
                if 0 <= v < owners.shape[0] and 0 <= u < owners.shape[1] and owners[v, u] == owners[start]:
                    stack.append((v, u))
        count += 1
    return labels


def absorbed(owners: NDArray[np.int32], min_area: int) -> NDArray[np.int32]:
    """The rule of `absorb_slivers`, spelt out with dictionaries."""
    owners = owners.copy()
    while True:
        labels = flooded(owners)
        areas = Counter(labels.ravel().tolist())
        slivers = sorted((area, label) for label, area in areas.items() if area < min_area)
        if not slivers or len(areas) == 1:
            return owners
        for _, label in slivers:
            pixels = list(zip(*np.nonzero(labels == label), strict=True))
            around = [
                (y + dy, x + dx)
                for y, x in pixels
                for dy, dx in ((-1, 0), (0, -1), (0, 1), (1, 0))
                if 0 <= y + dy < owners.shape[0] and 0 <= x + dx < owners.shape[1]
            ]
            around = [p for p in around if labels[p] != label]
            if any(owners[p] == owners[pixels[0]] for p in around):
                continue
            border = Counter(int(owners[p]) for p in around)
            largest = {o: max(areas[int(labels[p])] for p in around if owners[p] == o) for o in border}
            best = max(border, key=lambda o: (border[o], largest[o]))  # the first met wins a tie
            owners[labels == label] = best


@given(owner_maps)
def test_components_are_those_of_a_flood_fill_in_raster_order(owners: NDArray[np.int32]) -> None:
    np.testing.assert_array_equal(connected_components(owners), flooded(owners))


@given(owner_maps, st.integers(1, 16))
def test_slivers_follow_the_rule_as_spelt_out(owners: NDArray[np.int32], min_area: int) -> None:
    np.testing.assert_array_equal(absorb_slivers(owners, min_area), absorbed(owners, min_area))


@given(owner_maps)
def test_no_sliver_is_left(owners: NDArray[np.int32]) -> None:
    areas = np.bincount(connected_components(absorb_slivers(owners)).ravel())
    assert len(areas) == 1 or areas.min() >= 16


def test_corner_contact_is_not_connection() -> None:
    assert connected_components(np.eye(2, dtype=np.int32)).tolist() == [[0, 1], [2, 3]]


def test_a_sliver_joins_the_longest_border_and_reunites_its_parts() -> None:
    owners = np.zeros((8, 11), dtype=np.int32)
    owners[:, 5] = 1  # eight pixels across a field of zeros
    assert not absorb_slivers(owners).any()


def test_noise_of_many_owners_ends() -> None:
    noise = np.random.default_rng(3).integers(0, 1000, (300, 400)).astype(np.int32)
    assert np.bincount(connected_components(absorb_slivers(noise)).ravel()).min() >= 16


@given(owners=owner_maps, min_area=st.integers(1, 20))
def test_bridges_are_pixels_of_lower_owners_beside_corners(owners: NDArray[np.int32], min_area: int) -> None:
    """Of the highest owner at least: what others are beside may have become a bridge of a higher one."""
    bridged = owners.copy()
    bridge_slivers(bridged, min_area)
    changed = list(zip(*np.nonzero(bridged != owners), strict=True))
    padded = np.pad(bridged, 1, constant_values=-1)
    for y, x in changed:
        assert bridged[y, x] > owners[y, x]
        if bridged[y, x] < owners.max():
            continue
        around = padded[y : y + 3, x : x + 3] == bridged[y, x]
        assert around[1, [0, 2]].any()
        assert around[[0, 2], 1].any()
    if min_area == 1:
        assert not changed


def test_a_staircase_of_pixels_becomes_one_line() -> None:
    """As much as it takes, and from what is below."""
    for slope in (1, -1):
        owners = np.zeros((8, 8), np.int32)
        for k in range(8):
            owners[k, k if slope > 0 else 7 - k] = 2
        bridged = owners.copy()
        bridge_slivers(bridged)
        assert (bridged == 2).sum() == 15
        assert connected_components(bridged).max() == 2
        below = np.where(owners == 2, 2, 3).astype(np.int32)
        bridge_slivers(below)
        np.testing.assert_array_equal(below == 2, owners == 2)
