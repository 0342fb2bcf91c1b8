"""The search for the error whose file has the size that was asked for."""

from __future__ import annotations

from typing import Any

import pytest
from skimage import data

from gcvec import InputError, Options, vectorize
from gcvec.refine_bytes import CLOSE, MOST_RUNS, refine_to_bytes


class Refinement:
    """A file whose size falls with a power of the error, above what its regions take."""

    def __init__(self, power: float, regions: int) -> None:
        self.power, self.regions = power, regions
        self.runs: list[float] = []

    def __call__(self, mse: float) -> tuple[bytes, Any]:
        self.runs.append(mse)
        return bytes(self.regions + int(90_000 * mse**self.power)), mse


@pytest.mark.parametrize("target", [3_000, 20_000, 50_000, 150_000])
@pytest.mark.parametrize(("power", "regions"), [(-0.5, 0), (-0.8, 0), (-0.8, 900), (-1.1, 500)])
def test_the_file_is_as_large_as_it_may_be(power: float, regions: int, target: int) -> None:
    refinement = Refinement(power, regions)
    data, mse = refine_to_bytes(refinement, target)
    assert CLOSE * target <= len(data) <= target
    assert mse == refinement.runs[-1]
    assert len(refinement.runs) <= MOST_RUNS


def test_a_size_below_that_of_the_regions_is_refused() -> None:
    with pytest.raises(InputError, match="regions alone take 9") as refusal:
        refine_to_bytes(Refinement(-0.8, 900), 500)
    assert refusal.value.pointer == "target_bytes"


def test_a_picture_is_made_to_fit() -> None:
    pixels = data.chelsea()[80:160, 120:220]
    free = vectorize(pixels, None, Options(target_mse=2))
    target = int(0.8 * len(free.to_bytes()))
    fitted = vectorize(pixels, None, Options(target_bytes=target))
    assert len(fitted.to_bytes()) <= target
    assert fitted.report.bytes == len(fitted.to_bytes())
    assert fitted.report.mse > free.report.mse
    assert fitted.warnings == ()
