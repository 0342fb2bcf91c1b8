"""What rounding costs, against colours that are rounded, and what is learnt of it."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.quantization import UNITS, Quantization
from gcvec.refinement.rounding import (
    CAREFUL,
    ENERGY,
    LARGEST_STEP,
    LEAST_AIM,
    LEAST_LESSON,
    LEAST_STEP,
    LOSS,
    MORE_CAREFUL,
    MOST,
    PLANNED,
    SHARE,
    Rounding,
)

STEPS = Quantization()
TARGET = 5.0
DENSITY = 0.2
"""Colours for each pixel of a photo."""

TO_BYTES = 1 / 12


def fresh() -> Rounding:
    return Rounding(TARGET)


def levels(steps: Quantization) -> float:
    return 255 * steps.point_step / UNITS


@pytest.mark.parametrize("step", [32, 64, 160])
def test_cost_is_that_of_colours_rounded_to_steps_and_then_to_bytes(step: int) -> None:
    """For as many colours as pixels, which reach them as they are if they are stored in steps that much
    smaller. The loss, beyond rounding to nearest, is that of a file."""
    steps = Quantization(point_step=step)
    colors = np.random.default_rng(0).uniform(0.1, 0.9, 200_000)
    own = steps.point * ENERGY**0.5
    to_steps = 65025 * np.mean((np.round(colors / own) * own - colors) ** 2)
    to_bytes = np.mean((np.round(255 * colors) - 255 * colors) ** 2)
    assert fresh().cost(steps, 1.0) == pytest.approx(LOSS * to_steps + to_bytes, rel=0.02)


def test_cost_goes_with_the_number_of_colours() -> None:
    """Without any only the rounding to bytes is left."""
    none, half, whole = (fresh().cost(STEPS, density) for density in (0.0, 0.5, 1.0))
    assert none == pytest.approx(TO_BYTES)
    assert whole - none == pytest.approx(2 * (half - none))


@pytest.mark.parametrize("density", [0.1, 0.2, 0.8])
def test_steps_cost_what_is_planned(density: float) -> None:
    cost = fresh().cost(fresh().steps(density), density)
    assert cost == pytest.approx(TO_BYTES + PLANNED * TARGET, rel=0.02)


def test_steps_have_bounds() -> None:
    assert levels(fresh().steps(0.0)) == pytest.approx(LARGEST_STEP * TARGET**0.5, rel=0.01)
    assert levels(Rounding(1e-4).steps(5.0)) == LEAST_STEP


def test_the_aim_leaves_room_for_rounding() -> None:
    rounding = fresh()
    cost = rounding.cost(rounding.steps(DENSITY), DENSITY)
    assert rounding.aim(DENSITY) + cost < TARGET
    assert rounding.aim(DENSITY) == pytest.approx(CAREFUL * (TARGET - cost), rel=0.01)


def test_the_aim_is_higher_where_steps_are_bounded() -> None:
    """Then rounding adds less than is planned."""
    few = 0.01
    assert fresh().aim(few) == pytest.approx(CAREFUL * (TARGET - fresh().cost(fresh().steps(few), few)))
    assert fresh().aim(few) > 1.1 * fresh().aim(DENSITY)


def test_the_aim_never_falls_below_a_share_of_the_target() -> None:
    assert Rounding(0.1).aim(DENSITY) == pytest.approx(CAREFUL * LEAST_AIM * 0.1)


def test_rounding_to_steps_is_expected_to_cost_as_many_times_more_as_it_did() -> None:
    rounding, foreseen = fresh(), fresh().cost(STEPS, DENSITY)
    rounding.learn(STEPS, DENSITY, 3.0, 3.0 + 1.5 * foreseen, 0.0)
    assert rounding.cost(STEPS, DENSITY) - TO_BYTES == pytest.approx(1.5 * (foreseen - TO_BYTES))
    assert rounding.steps(DENSITY).point == pytest.approx(fresh().steps(DENSITY).point / 1.5**0.5, rel=0.01)


def test_a_file_that_cost_nothing_is_not_believed() -> None:
    rounding, foreseen = fresh(), fresh().cost(STEPS, DENSITY)
    rounding.learn(STEPS, DENSITY, 4.0, 4.0, 0.0)
    assert rounding.cost(STEPS, DENSITY) - TO_BYTES == pytest.approx(LEAST_LESSON * (foreseen - TO_BYTES))


NO_COLORS = 0.0
"""As density: rounding adds what it adds to bytes, whatever is learnt of colours."""


def test_a_target_that_was_kept_leaves_the_margin() -> None:
    rounding = fresh()
    rounding.learn(STEPS, NO_COLORS, 4.0, TARGET, 0.0)
    assert rounding.aim(NO_COLORS) == fresh().aim(NO_COLORS)


def test_a_target_that_was_missed_makes_more_careful() -> None:
    """The next aim is lower, by what is missing beyond the error that was there before rounding."""
    rounding = fresh()
    aim = rounding.aim(NO_COLORS)
    rounding.learn(STEPS, NO_COLORS, aim, 1.1 * TARGET, 0.0)
    assert rounding.aim(NO_COLORS) == pytest.approx(aim * MORE_CAREFUL / 1.1)


def test_a_miss_that_came_of_too_high_an_error_is_not_the_aims_fault() -> None:
    """Before rounding the error was twice what was aimed at: that is no reason to aim lower."""
    rounding = fresh()
    aim = rounding.aim(NO_COLORS)
    rounding.learn(STEPS, NO_COLORS, 2 * aim, 1.5 * TARGET, 0.0)
    assert rounding.aim(NO_COLORS) == pytest.approx(aim * MORE_CAREFUL)


def test_what_no_point_can_save_counts_neither_before_nor_after() -> None:
    one, other = fresh(), fresh()
    one.learn(STEPS, NO_COLORS, 4.5, 5.5, 0.0)
    other.learn(STEPS, NO_COLORS, 6.5, 7.5, 2.0)
    assert one.aim(NO_COLORS) == pytest.approx(other.aim(NO_COLORS))
    kept = fresh()
    kept.learn(STEPS, NO_COLORS, 4.0, TARGET + 2, 2.0)
    assert kept.aim(NO_COLORS) == fresh().aim(NO_COLORS)


def weighed(rise: float) -> Rounding:
    rounding = fresh()
    rounding.weigh(rise)
    return rounding


@pytest.mark.parametrize("rise", [-0.5, 0.0, 0.3])
def test_where_points_are_dear_steps_stay_as_planned(rise: float) -> None:
    assert weighed(rise).steps(DENSITY) == fresh().steps(DENSITY)


def test_where_points_are_cheap_steps_are_those_of_the_fewest_bytes() -> None:
    """By going through all steps: errors fall with a power of the points, and bytes a point with one of the
    steps."""
    rise, planned = 1.2, fresh().steps(DENSITY)
    steps = [planned.scaled(factor) for factor in np.linspace(0.8, 1.6, 81)]

    def total(step: Quantization) -> float:
        points = (TARGET - fresh().cost(step, DENSITY)) ** (-1 / rise)
        return float(points * step.point_step ** (-2 * SHARE))

    best = min(steps, key=total)
    assert planned.point_step < best.point_step < MOST**0.5 * planned.point_step
    assert weighed(rise).steps(DENSITY).point_step == pytest.approx(best.point_step, rel=0.07)
    assert weighed(rise).aim(DENSITY) < fresh().aim(DENSITY)


def test_steps_grow_no_further_than_points_can_follow() -> None:
    cost = weighed(50.0).cost(weighed(50.0).steps(DENSITY), DENSITY)
    assert cost == pytest.approx(MOST * (TO_BYTES + PLANNED * TARGET), rel=0.02)


def test_gray_pictures_take_larger_steps() -> None:
    gray, density = Rounding(TARGET, axes=1), 0.4
    assert gray.aim(density) == pytest.approx(fresh().aim(density), rel=1e-3)
    assert gray.steps(density).point == pytest.approx(3**0.5 * fresh().steps(density).point, rel=0.01)
