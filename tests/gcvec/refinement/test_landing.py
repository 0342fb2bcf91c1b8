"""The steps whose file comes closest to the error wanted."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage import data

from gcvec import Options, vectorize
from gcvec.quantization import Quantization
from gcvec.refinement.landing import KEPT, LEAST_SCALE, MOST_SCALE, MOST_TRIES, landing_steps

TARGET = 5.0


@dataclass
class Rounding:
    """Rounding that adds `loss` s² to the error, and somewhat more or less by its step s."""

    before: float
    loss: float
    uneven: tuple[float, ...] = (1.0,)
    tried: list[int] = field(default_factory=list)

    def mse(self, step: int) -> float:
        return self.before + self.loss * step**2 * self.uneven[step % len(self.uneven)]

    def __call__(self, steps: Quantization) -> float:
        assert steps.boundary_step == steps.point_step
        self.tried.append(steps.point_step)
        return self.mse(steps.point_step)


planned = st.integers(8, 256).map(lambda step: Quantization(boundary_step=step, point_step=step))


@given(
    planned,
    st.floats(0.5, 5.5),
    st.floats(0.2, 3),
    st.floats(0.2, 2),
    st.lists(st.floats(0.95, 1.05), min_size=1, max_size=5),
)
def test_the_target_is_kept_where_steps_can_keep_it(
    steps: Quantization, before: float, rounding: float, guess: float, uneven: list[float]
) -> None:
    """However wrong the guess is, no more steps are tried than a few, and the best of them are taken."""
    added = Rounding(before, rounding / steps.point_step**2, tuple(uneven))
    found = landing_steps(added, steps, before, rounding * guess, TARGET).point_step
    assert len(added.tried) == len(set(added.tried)) <= MOST_TRIES
    if before >= TARGET:
        assert found == steps.point_step
        assert not added.tried
        return
    assert all(LEAST_SCALE * steps.point_step <= s <= MOST_SCALE * steps.point_step for s in added.tried)
    kept = [s for s in added.tried if added.mse(s) <= KEPT * TARGET]
    assert found == (max(kept) if kept else min(added.tried, key=added.mse))
    if not kept:
        smallest = min(added.tried)
        assert smallest - 1 < LEAST_SCALE * steps.point_step or len(added.tried) == MOST_TRIES


@pytest.mark.parametrize(("before", "step"), [(4.0, 69), (4.24, 60), (3.0, 80), (4.9, 48)])
def test_steps_go_with_the_root_of_what_rounding_may_cost(before: float, step: int) -> None:
    """64 steps cost 0.85 here; no step is smaller than 48 or larger than 80."""
    added = Rounding(before, 0.85 / 64**2)
    planned = Quantization(boundary_step=64, point_step=64)
    assert landing_steps(added, planned, before, 0.85, TARGET) == Quantization(
        boundary_step=step, point_step=step
    )
    assert added.tried == [step]


@pytest.mark.parametrize("target", [3.0, 8.0])
def test_pictures_come_close_to_their_targets(target: float) -> None:
    pixels = np.ascontiguousarray(data.coffee()[100:260, 200:400])
    report = vectorize(pixels, options=Options(target_mse=target, max_points=0)).report
    assert 0.98 * target < report.mse <= target
