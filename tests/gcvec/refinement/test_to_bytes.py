"""The search for the error whose file has the size that was asked for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from skimage import data

from gcvec import InputError, Options, Progress, vectorize
from gcvec.progress import EXCHANGED
from gcvec.refinement.to_bytes import CLOSE, MOST_RUNS, MSE_RANGE, POOR, likely_mse, refine_to_bytes


class File(NamedTuple):
    data: bytes
    mse: float


class Refinement:
    """A file whose size falls with a power of the error, above what its regions take."""

    def __init__(self, power: float, regions: int) -> None:
        self.power, self.regions = power, regions
        self.runs: list[float] = []

    def __call__(self, mse: float) -> File:
        self.runs.append(mse)
        return File(bytes(self.regions + int(90_000 * mse**self.power)), mse)


@pytest.mark.parametrize("target", [3_000, 20_000, 50_000, 150_000])
@pytest.mark.parametrize(("power", "regions"), [(-0.5, 0), (-0.8, 0), (-0.8, 900), (-1.1, 500)])
@pytest.mark.parametrize("first_mse", [2.0, 10.0, 100.0])
def test_the_file_is_as_large_as_it_may_be(power: float, regions: int, target: int, first_mse: float) -> None:
    refinement = Refinement(power, regions)
    data, mse = refine_to_bytes(refinement, target, first_mse)
    assert CLOSE * target <= len(data) <= target
    assert mse == refinement.runs[-1]
    assert len(refinement.runs) <= MOST_RUNS


def test_a_size_that_falls_in_leaps_is_closed_in_on() -> None:
    """As where borders take most of a file: far from a power of the error, and in uneven steps."""

    def refine(mse: float) -> File:
        runs.append(mse)
        step = 1.03 ** (int(97 * np.log(mse)) % 2)
        return File(bytes(int(step * (600 + 40_000 * mse**-1.5 + 4_000 * mse**-0.2))), mse)

    for target in (2_000, 2_500, 4_000, 12_000):
        for first_mse in (1.0, 10.0, 500.0):
            runs: list[float] = []
            data, _ = refine_to_bytes(refine, target, first_mse)
            assert 0.93 * target <= len(data) <= target
            assert len(runs) <= MOST_RUNS


def test_the_first_error_is_the_usual_one_where_the_points_of_that_just_fit() -> None:
    assert likely_mse(5_000, 10_000) == pytest.approx(5)
    assert likely_mse(5_000, 1_000) > 50 > 5 > likely_mse(5_000, 20_000)
    assert likely_mse(0, 2) == likely_mse(1, 2) == pytest.approx(5)


def test_a_size_below_that_of_the_regions_is_refused() -> None:
    with pytest.raises(InputError, match="coarsest version takes 9") as refusal:
        refine_to_bytes(Refinement(-0.8, 900), 500, 10.0)
    assert refusal.value.pointer == "target_bytes"


def test_the_coarsest_version_is_tried_before_giving_up() -> None:
    """A size that jumps: the secant method alone would not come to the error that is large enough."""
    runs: list[float] = []

    def refine(mse: float) -> File:
        runs.append(mse)
        return File(bytes(400 if mse >= MSE_RANGE[1] else 5_000 + int(100 / mse)), mse)

    data, mse = refine_to_bytes(refine, 4_999, 10.0)
    assert (len(data), mse) == (400, MSE_RANGE[1])
    assert len(runs) <= MOST_RUNS + 1


@pytest.mark.parametrize("target", [1_500, 2_500, 4_000, 8_000])
@pytest.mark.parametrize("plateau", [30_000, 20_000])
def test_a_leap_far_from_the_first_error_is_come_to(target: int, plateau: int) -> None:
    """As with noise: errors up to 1000 take about as many bytes, and one above 5500 next to none."""
    runs: list[float] = []

    def refine(mse: float) -> File:
        runs.append(mse)
        share = np.clip(np.log(mse / 1000) / np.log(5.5), 0, 1)
        return File(bytes(88 + int((plateau + len(runs) % 3) * (1 - share))), min(mse, 5500))

    data, _ = refine_to_bytes(refine, target, 10.0)
    assert POOR * target <= len(data) <= target
    assert len(runs) <= 2 * MOST_RUNS


@pytest.mark.parametrize("target", [5_000, 20_000, 60_000])
def test_errors_out_of_reach_do_not_lead_astray(target: int) -> None:
    """As with noise: below an error of 650 files only grow, and they have next to nothing at 5500."""
    runs: list[float] = []

    def refine(mse: float) -> File:
        runs.append(mse)
        reached = float(np.clip(mse, 650, 5500))
        waste = 70_000 * (650 / mse) ** 0.08 if mse < 650 else 70_000
        return File(bytes(100 + int(waste * (5500 - reached) / 4850)), reached)

    data, _ = refine_to_bytes(refine, target, 10.0)
    assert CLOSE * target <= len(data) <= target
    assert len(runs) <= 2 * MOST_RUNS


def test_where_all_files_are_small_the_search_ends_early() -> None:
    """As with noise in regions that may have few points: what is out of reach comes to any small size."""
    sizes, runs = [1763, 1650, 1212, 1508, 1279, 1457], list[float]()

    def refine(mse: float) -> File:
        runs.append(mse)
        size = sizes[len(runs) % len(sizes)]
        return File(bytes(size), 5500 - size / 10)

    refine_to_bytes(refine, 20_000, 14.0)
    assert len(runs) <= MOST_RUNS


def test_larger_files_that_are_no_better_are_not_gone_for() -> None:
    """Below an error of 12 bytes buy nothing, as where every region has as many points as it may have."""
    runs: list[float] = []

    def refine(mse: float) -> File:
        runs.append(mse)
        return File(bytes(int(90_000 * mse**-0.8)), max(mse, 12.0 + mse / 1000))

    found = refine_to_bytes(refine, 80_000, 10.0)
    assert found.mse == pytest.approx(12, rel=0.01)
    assert len(runs) <= 3


def test_the_best_file_that_fits_is_taken_not_the_largest() -> None:
    errors = iter([20.0, 30.0, 30.0, 30.0, 30.0, 30.0, 30.0])
    sizes = iter([9_000, 9_500, 9_600, 9_600, 9_600, 9_600, 9_600])
    found = refine_to_bytes(lambda mse: File(bytes(next(sizes)), next(errors)), 10_000, 10.0)
    assert found.mse == 20


def test_a_picture_is_made_to_fit() -> None:
    pixels = data.chelsea()[80:160, 120:220]
    free = vectorize(pixels, None, Options(target_mse=2))
    target = int(0.8 * len(free.to_bytes()))
    fitted = vectorize(pixels, None, Options(target_bytes=target))
    assert len(fitted.to_bytes()) <= target
    assert fitted.report.bytes == len(fitted.to_bytes())
    assert fitted.report.mse > free.report.mse
    assert fitted.warnings == ()


def test_several_runs_are_told_as_one() -> None:
    """The share of the work done goes on rising, and iterations are those of the run whose file it is."""
    pixels = data.chelsea()[80:160, 120:220]
    told: list[Progress] = []
    fitted = vectorize(pixels, None, Options(target_bytes=1200), told.append)
    assert fitted.report is not None
    rounds = [p for p in told if p.phase == "refine"]
    begins = [i for i, p in enumerate(rounds) if p.iteration == 1]
    assert len(begins) > 1
    fractions = [p.fraction for p in told]
    assert fractions == sorted(fractions)
    assert all(rounds[i].fraction < 0.95 for i in begins)
    assert rounds[begins[1] - 1].fraction == pytest.approx(0.1 + 0.425 * EXCHANGED, abs=1e-6)
    longest = max(b - a for a, b in zip(begins, [*begins[1:], len(rounds)], strict=True))
    assert max(region.iterations for region in fitted.report.regions) <= longest


def test_automatic_regions_leave_room_in_a_small_file() -> None:
    pixels = data.chelsea()[80:160, 120:220]
    image = vectorize(pixels, None, Options(target_bytes=700))
    assert len(image.to_bytes()) <= 700
    assert len(image.labels) <= 2
