"""The file that comes closest to the error wanted."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from skimage import data

from gcvec import Options, vectorize
from gcvec.quantization import Quantization
from gcvec.refinement.draft import Draft
from gcvec.refinement.landing import LEAST_SCALE, MOST_FILES, MOST_SCALE, landed
from gcvec.vector_image import VectorImage

TARGET = 5.0


@dataclass
class Filing:
    """Files whose rounding adds `loss` s² to the error, and somewhat more or less by their step s."""

    image: VectorImage
    before: float
    loss: float
    uneven: tuple[float, ...] = (1.0,)
    steps: list[int] = field(default_factory=list)

    def mse(self, step: int) -> float:
        return self.before + self.loss * step**2 * self.uneven[step % len(self.uneven)]

    def __call__(self, steps: Quantization) -> Draft:
        self.steps.append(steps.point_step)
        return Draft(b"", replace(self.image, quantization=steps), self.mse(steps.point_step))


@pytest.fixture(scope="module")
def image() -> VectorImage:
    return vectorize(np.ascontiguousarray(data.astronaut()[:8, :8]), options=Options(workers=1))


planned = st.integers(8, 256).map(lambda step: Quantization(boundary_step=step, point_step=step))


@given(
    planned,
    st.floats(0.5, 5.5),
    st.floats(0.2, 3),
    st.floats(0.2, 2),
    st.lists(st.floats(0.95, 1.05), min_size=1, max_size=5),
)
def test_the_target_is_kept_where_steps_can_keep_it(
    image: VectorImage,
    steps: Quantization,
    before: float,
    rounding: float,
    guess: float,
    uneven: list[float],
) -> None:
    """However wrong the guess is, no more files are made than a few, and the best of them is taken."""
    file = Filing(image, before, rounding / steps.point_step**2, tuple(uneven))
    found = landed(file, steps, before, rounding * guess, TARGET)
    assert len(file.steps) == len(set(file.steps)) <= MOST_FILES
    if before >= TARGET:
        assert file.steps == [steps.point_step]
        return
    assert all(LEAST_SCALE * steps.point_step <= s <= MOST_SCALE * steps.point_step for s in file.steps)
    kept = [s for s in file.steps if file.mse(s) <= TARGET]
    assert found.steps.point_step == (max(kept, key=file.mse) if kept else min(file.steps, key=file.mse))
    if not kept:
        smallest = min(file.steps)
        assert file.mse(smallest) > TARGET
        assert smallest - 1 < LEAST_SCALE * steps.point_step or len(file.steps) == MOST_FILES


@pytest.mark.parametrize(("before", "step"), [(4.0, 69), (4.24, 60), (3.0, 80), (4.9, 48)])
def test_steps_go_with_the_root_of_what_rounding_may_cost(
    image: VectorImage, before: float, step: int
) -> None:
    """64 steps cost 0.85 here; no step is smaller than 48 or larger than 80."""
    file = Filing(image, before, 0.85 / 64**2)
    assert landed(file, Quantization(), before, 0.85, TARGET).steps == Quantization(
        boundary_step=step, point_step=step
    )
    assert file.steps == [step]


@pytest.mark.parametrize("target", [3.0, 8.0])
def test_pictures_come_close_to_their_targets(target: float) -> None:
    pixels = np.ascontiguousarray(data.coffee()[100:260, 200:400])
    report = vectorize(pixels, options=Options(target_mse=target, max_points=0)).report
    assert 0.98 * target < report.mse <= target
