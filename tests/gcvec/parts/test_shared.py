"""Pixels that parts of a picture share, against the photo."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gcvec.parts.division import divided, part_of
from gcvec.parts.messages import PartResult
from gcvec.parts.shared import Shared, shared_pixels
from tests.gcvec.parts.made import a_result
from tests.gcvec.scenes import foundation_of

Floats = np.ndarray


def shared_by_three(
    given: Callable[[Floats, Floats], Floats], measured: float = 0.0
) -> tuple[Shared, list[PartResult], Floats]:
    """What three parts that share all their pixels are wanted to give if each gives `given` of its cover and
    the photo, and has `measured` this squared error; their states, and the photo there."""
    foundation = foundation_of("voronoi")
    parts = [part_of(foundation, patches) for patches in divided(foundation, 3)]
    height, width = foundation.network.height, foundation.network.width
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
    photo = pixels.reshape(-1, 3) / 255
    frames = [frame_of(part.origin, part.network.width, part.network.height, width) for part in parts]
    weights = [rng.uniform(0.1, 1, len(frame)) for frame in frames]
    total = np.bincount(np.concatenate(frames), np.concatenate(weights), width * height)
    states = []
    for k, (frame, weight) in enumerate(zip(frames, weights, strict=True)):
        cover = (weight / total[frame]).astype(np.float32)
        states.append(
            replace(
                a_result(),
                number=k,
                shared=np.arange(len(frame)),
                cover=cover,
                given=given(cover[:, None], photo[frame]).astype(np.float32),
                square_shared=measured,
            )
        )
    covered = np.unique(np.concatenate(frames))
    found = shared_pixels(pixels, parts, states)
    assert found.n == len(covered)
    wanted = np.zeros_like(photo)
    for frame, own in zip(frames, found.wanted, strict=True):
        np.add.at(wanted, frame, own)
    np.testing.assert_allclose(wanted[covered], photo[covered], atol=1e-5)
    return found, states, photo[covered]


def frame_of(origin: Floats, width: int, height: int, picture_width: int) -> Floats:
    """The pixels of a part's frame, as the picture numbers them."""
    y, x = np.mgrid[:height, :width]
    return ((y + origin[1]) * picture_width + x + origin[0]).ravel()


def test_what_is_right_is_wanted_as_it_is_given() -> None:
    found, states, _ = shared_by_three(lambda cover, photo: cover * photo)
    assert found.excess == pytest.approx(0, abs=1e-6)
    for state, wanted in zip(states, found.wanted, strict=True):
        np.testing.assert_allclose(wanted, state.given, atol=1e-5)


def test_what_lacks_is_wanted_by_the_shares_that_parts_cover() -> None:
    found, states, photo = shared_by_three(lambda cover, photo: 0 * photo)
    assert found.excess == pytest.approx((photo**2).sum())
    for state, wanted in zip(states, found.wanted, strict=True):
        assert (wanted.max(axis=1) <= state.cover + 1e-6).all()


def test_what_parts_have_measured_themselves_counts_once() -> None:
    found, _, photo = shared_by_three(lambda cover, photo: 0.5 * cover * photo, measured=2.0)
    assert found.excess == pytest.approx((photo**2).sum() / 4 - 6, rel=1e-5)
