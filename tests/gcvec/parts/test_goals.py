"""What the parts of a picture are asked for next, given how their errors fell."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gcvec.parts.goals import common_goals
from gcvec.parts.messages import PartResult
from tests.gcvec.parts.made import a_result


def state(points: int, square: float, power: float, *, more: bool = True) -> PartResult:
    """A part whose error has fallen with this power of its number of points."""
    course = [(points / 4, square * 4**power), (points, square)]
    return replace(
        a_result(),
        points=np.zeros((points, 2), np.int64),
        square=square,
        lack=0.0,
        course=np.array(course),
        more=more,
    )


def test_goals_add_up_and_have_one_price() -> None:
    states = [state(1000, 8.0, 1.0), state(200, 3.0, 0.6), state(50, 9.0, 1.6)]
    goals = common_goals(states, 10.0)
    assert goals.sum() == pytest.approx(10)
    prices = []
    for part, goal, power in zip(states, goals, (1.0, 0.6, 1.6), strict=True):
        points = len(part.points) * (part.square / goal) ** (1 / power)
        prices.append(power * goal / points)
    assert prices == pytest.approx([prices[0]] * 3)


def test_parts_that_nothing_helps_stay_as_they_are() -> None:
    states = [state(1000, 8.0, 1.0), state(200, 3.0, 1.0, more=False)]
    assert common_goals(states, 5.0) == pytest.approx([2.0, 3.0])
    alone = [state(200, 3.0, 1.0, more=False), state(0, 1.0, 1.0)]
    assert common_goals(alone, 1.0) == pytest.approx([3.0, 1.0])


def test_what_full_regions_lack_is_asked_of_nobody() -> None:
    states = [replace(state(1000, 8.0, 1.0), lack=5.0), state(1000, 3.0, 1.0)]
    assert common_goals(states, 4.0) == pytest.approx([2.0, 2.0])
