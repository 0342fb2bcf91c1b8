"""What rounding costs, against colours that are rounded, and what is learnt of it."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.quantization import Quantization
from gcvec.refinement.rounding import (
    CAREFUL,
    COARSEST,
    LEAST_AIM,
    LEAST_LESSON,
    LOSS,
    MORE_CAREFUL,
    SHARE,
    Rounding,
)

STEPS = Quantization()
TARGET = 5.0


def fresh() -> Rounding:
    return Rounding(TARGET, STEPS)


@pytest.mark.parametrize("step", [8, 16, 40])
def test_cost_is_that_of_colours_rounded_to_steps_and_then_to_bytes(step: int) -> None:
    """For colours that reach pixels as they are. The loss, beyond rounding to nearest, is that of a file."""
    steps = Quantization(point_step=step)
    colors = np.random.default_rng(0).uniform(0.1, 0.9, 200_000)
    rounded = np.round(colors / steps.point) * steps.point
    to_steps = 65025 * np.mean((rounded - colors) ** 2)
    to_bytes = np.mean((np.round(255 * colors) - 255 * colors) ** 2)
    assert fresh().cost(steps, 1.0) == pytest.approx(LOSS * to_steps + to_bytes, rel=0.02)


def test_cost_goes_with_the_energy_of_colours() -> None:
    """Without any only the rounding to bytes is left."""
    none, half, whole = (fresh().cost(STEPS, energy) for energy in (0.0, 0.5, 1.0))
    assert none == pytest.approx(1 / 12)
    assert whole - none == pytest.approx(2 * (half - none))


@pytest.mark.parametrize("energy", [0.1, 0.6])
def test_the_aim_leaves_room_for_rounding(energy: float) -> None:
    rounding = fresh()
    assert rounding.aim(energy) + rounding.cost(STEPS, energy) < TARGET
    assert rounding.aim(energy) == pytest.approx(CAREFUL * (TARGET - rounding.cost(STEPS, energy)))


def test_the_aim_never_falls_below_a_share_of_the_target() -> None:
    coarse = Quantization(point_step=400)
    assert Rounding(TARGET, coarse).aim(1.0) == CAREFUL * LEAST_AIM * TARGET


def test_rounding_to_steps_is_expected_to_cost_as_many_times_more_as_it_did() -> None:
    rounding, foreseen = fresh(), fresh().cost(STEPS, 0.6)
    rounding.learn(STEPS, 0.6, 3.0, 3.0 + 1.5 * foreseen, 0.0)
    assert rounding.cost(STEPS, 0.6) - 1 / 12 == pytest.approx(1.5 * (foreseen - 1 / 12))


def test_a_file_that_cost_nothing_is_not_believed() -> None:
    rounding = fresh()
    rounding.learn(STEPS, 0.6, 4.0, 4.0, 0.0)
    assert rounding.cost(STEPS, 0.6) - 1 / 12 == pytest.approx(
        LEAST_LESSON * (fresh().cost(STEPS, 0.6) - 1 / 12)
    )


def test_a_target_that_was_kept_leaves_the_margin() -> None:
    rounding, energy = fresh(), 0.0
    rounding.learn(STEPS, energy, 4.0, TARGET, 0.0)
    assert rounding.aim(energy) == pytest.approx(CAREFUL * (TARGET - 1 / 12))


def test_a_target_that_was_missed_makes_more_careful() -> None:
    """The next aim is lower, by what is missing beyond the error that was there before rounding."""
    rounding, energy = fresh(), 0.0
    aim = rounding.aim(energy)
    rounding.learn(STEPS, energy, aim, 1.1 * TARGET, 0.0)
    assert rounding.aim(energy) == pytest.approx(aim * MORE_CAREFUL / 1.1)


def test_a_miss_that_came_of_too_high_an_error_is_not_the_aims_fault() -> None:
    """Before rounding the error was twice what was aimed at: that is no reason to aim lower."""
    rounding, energy = fresh(), 0.0
    aim = rounding.aim(energy)
    rounding.learn(STEPS, energy, 2 * aim, 1.5 * TARGET, 0.0)
    assert rounding.aim(energy) == pytest.approx(aim * MORE_CAREFUL)


def test_what_no_point_can_save_counts_neither_before_nor_after() -> None:
    one, other = fresh(), fresh()
    one.learn(STEPS, 0.0, 4.5, 5.5, 0.0)
    other.learn(STEPS, 0.0, 6.5, 7.5, 2.0)
    assert one.aim(0.0) == pytest.approx(other.aim(0.0))
    kept = fresh()
    kept.learn(STEPS, 0.0, 4.0, TARGET + 2, 2.0)
    assert kept.aim(0.0) == pytest.approx(CAREFUL * (TARGET - 1 / 12))


ENERGY = 0.44
"""What colours give to a pixel of a photo."""


def weighed(rise: float) -> Rounding:
    rounding = fresh()
    rounding.weigh(rise, ENERGY)
    return rounding


@pytest.mark.parametrize("rise", [-0.5, 0.0, 0.3])
def test_where_points_are_dear_steps_stay_as_planned(rise: float) -> None:
    assert weighed(rise).steps == STEPS


def test_where_points_are_cheap_steps_are_those_of_the_fewest_bytes() -> None:
    """By going through all steps: errors fall with a power of the points, and bytes a point with one of the
    steps."""
    rise = 1.2
    steps = [STEPS.scaled(factor) for factor in np.linspace(0.8, 1.6, 81)]

    def total(step: Quantization) -> float:
        points = (TARGET - fresh().cost(step, ENERGY)) ** (-1 / rise)
        return float(points * step.point_step ** (-2 * SHARE))

    best = min(steps, key=total)
    assert STEPS.point_step < best.point_step < COARSEST * STEPS.point_step
    assert weighed(rise).steps.point_step == pytest.approx(best.point_step, rel=0.07)
    assert weighed(rise).aim(ENERGY) < fresh().aim(ENERGY)


def test_steps_grow_no_further_than_points_can_follow() -> None:
    assert weighed(50.0).steps == STEPS.scaled(COARSEST)


def test_gray_pictures_are_expected_to_lose_as_much_to_larger_steps() -> None:
    gray = Quantization.for_error(TARGET, axes=1)
    assert gray.point_step == pytest.approx(3**0.5 * STEPS.point_step, rel=0.01)
    rounding = Rounding(TARGET, gray, axes=1)
    assert rounding.cost(gray, ENERGY) == pytest.approx(fresh().cost(STEPS, ENERGY), rel=0.01)
