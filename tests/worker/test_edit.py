"""Edits as workers make them: one that changes nothing is refused, as the page of the interface says."""

from __future__ import annotations

from functools import cache
from typing import Any

import pytest

from gcvec import InputError, VectorImage, vectorize
from gcvec.io import read_annotations
from tests.shaded_box import BOX, GROUND, cvat, photo_pixels
from worker.edit import edited

RED = {"patch": 1, "color": "#ff4040"}


@cache
def image() -> VectorImage:
    return vectorize(photo_pixels(), read_annotations(cvat(GROUND, BOX).encode()))


def between() -> int:
    """The curve between box and ground."""
    return next(k for k, curve in enumerate(image().network.curves) if not curve.on_frame)


def move(dx: float, dy: float = 0.0) -> dict[str, Any]:
    return {"curve": between(), "index": 1, "dx": dx, "dy": dy}


def changes(moves: list[dict[str, Any]], recolors: list[dict[str, Any]]) -> dict[str, Any]:
    return {"moves": moves, "recolors": recolors}


@pytest.mark.parametrize(
    "shifts", [[0.0], [1e-6], [2.0, -2.0]], ids=["nowhere", "less than a step", "there and back"]
)
def test_moves_that_lead_nowhere_are_refused(shifts: list[float]) -> None:
    with pytest.raises(InputError, match="changes nothing") as refusal:
        edited(image(), changes([move(dx) for dx in shifts], []))
    assert (refusal.value.code, refusal.value.pointer) == ("invalid-request", "/body")


def test_a_patch_that_has_its_colour_already_is_not_given_it_again() -> None:
    red = VectorImage.from_bytes(edited(image(), changes([], [RED])).to_bytes())
    with pytest.raises(InputError, match="changes nothing"):
        edited(red, changes([], [RED]))


def test_a_move_is_taken_back_by_another_revision() -> None:
    there = VectorImage.from_bytes(edited(image(), changes([move(2.0)], [])).to_bytes())
    back = edited(there, changes([move(-2.0)], []))
    assert back.to_bytes() == image().to_bytes()


def test_one_change_beside_others_without_effect_is_enough() -> None:
    assert edited(image(), changes([move(0.0)], [RED])).recoloring is not None
    assert edited(image(), changes([move(0.0), move(1.0)], [])).control_points is not None
