"""The state of refinement: its points, colours and error belong together, and what it says of them is so."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest

from gcvec.metrics import squared_error
from gcvec.patches.canonical import lay_canvas
from gcvec.quantization import Quantization
from gcvec.raster import paint
from gcvec.refinement import state as state_module
from gcvec.refinement.bargains import LEAST_RETURN, Bargains, bargains
from gcvec.refinement.draft import image_of
from gcvec.refinement.scene import Iteration, Scene, Start, Terms
from gcvec.refinement.state import (
    CROWDED,
    EARLY,
    EARLY_NEAR,
    FEW,
    FIRST_POINTS,
    GROWTH,
    LEAST_CHANGE,
    NEAR,
    REPLACEMENT,
    RISE,
    SETTLED,
    Refinement,
)
from gcvec.timing import StageClock
from tests.gcvec.scenes import SCENES, foundation_of, some_points

FOUNDATION = foundation_of("voronoi")
N_BOUNDARY = FOUNDATION.space.size
N_PIXELS = FOUNDATION.network.width * FOUNDATION.network.height


def photo(height: float = 20) -> np.ndarray:
    """Regions of a colour each under waves that take points."""
    picture = SCENES["voronoi"].picture().astype(float)
    y, x = np.mgrid[: picture.shape[0], : picture.shape[1]]
    waves = height * np.sin(x / 4) * np.sin(y / 5)
    return np.asarray(np.clip(picture + waves[..., None], 0, 255)).astype(np.uint8)


def state_of(
    pixels: np.ndarray | None = None,
    aim: float = 5.0,
    max_points: int = 0,
    start: Start | None = None,
    on_iteration: Callable[[Iteration], None] = lambda _: None,
) -> Refinement:
    scene = Scene(photo() if pixels is None else pixels, FOUNDATION, np.full((N_BOUNDARY, 3), 0.5))
    terms = Terms(aim, max_points)
    return Refinement(scene, terms, lambda _: aim, on_iteration, StageClock(), start)


def begun(aim: float = 5.0, max_points: int = 0) -> Refinement:
    state = state_of(aim=aim, max_points=max_points)
    state.begin()
    return state


def shown(state: Refinement) -> np.ndarray:
    """The picture `(pixels, 3)` of a state's points and colours, drawn from them alone."""
    canvas = lay_canvas(state.foundation, state.points)
    drawing, operator, corner_color = canvas.unit
    network = state.foundation.network
    picture = paint(
        drawing.image, drawing.triangles, operator @ state.colors, corner_color, network.width, network.height
    )
    return np.asarray(picture).reshape(-1, 3)


def assert_true(state: Refinement) -> None:
    """Its error is that of the picture it stands for; points are distinct, by rows, of a colour each."""
    residual = state.truth - shown(state)
    np.testing.assert_allclose(state.residual, residual, atol=2e-5)
    assert state.mse == pytest.approx(65025 * (residual**2).mean(), rel=1e-3)
    assert len(state.colors) == N_BOUNDARY + len(state.points)
    x, y = state.points.T
    assert (np.diff(y * state.foundation.network.width + x) > 0).all()
    assert ((state.colors >= 0) & (state.colors <= 1)).all()


def test_every_round_leaves_a_state_that_is_true() -> None:
    state = state_of()
    state.begin()
    assert_true(state)
    for change in (
        lambda: state.seed(5.0),
        lambda: state.grow(3.0, early=False),
        lambda: state.exchange(0.2),
        lambda: state.catch_up(),
        lambda: state.settle(),
    ):
        change()
        assert_true(state)
    assert state.foundation.geometry.mesh.n_points == 0
    assert len(state.canvas.foldovers()) == 0


def test_the_error_of_other_colors_is_that_of_their_picture() -> None:
    state = begun()
    state.grow(3.0, early=False)
    off = np.random.default_rng(3).normal(0, 0.05, state.colors.shape)
    scene = Scene(photo(), state.foundation, np.full((N_BOUNDARY, 3), 0.5))
    image = image_of(state.canvas, state.points, state.colors + off, scene, Quantization())
    error = squared_error(image.render(), photo()).mean()
    assert state.mse_as_drawn(state.colors + off) == pytest.approx(error, rel=1e-4)


def test_growth_comes_near_the_aim_and_exchanges_come_closer() -> None:
    state = begun(aim=8.0)
    assert state.grow(3.0, early=False)
    assert state.mse <= NEAR * 8.0
    for _ in range(2):
        assert state.exchange(0.15)
    assert state.mse == pytest.approx(8.0, rel=0.1)


def test_colours_are_brought_closer_to_the_best_ones() -> None:
    """What is minimised, equation (7) with its pulls, falls with every fit of the same points."""
    state = begun()
    state.seed(5.0)

    def objective() -> float:
        prior, pull = state._pull()
        return float((state.residual**2).sum() + (pull[:, None] * (state.colors - prior) ** 2).sum())

    before = objective()
    state.converge()
    after = objective()
    assert after < before
    state.settle()
    assert objective() <= after * (1 + 1e-6)


def test_colours_are_pulled_to_their_first_estimates_and_to_the_photo() -> None:
    state = begun()
    state.seed(5.0)
    prior, pull = state._pull()
    np.testing.assert_array_equal(prior[:N_BOUNDARY], 0.5)
    np.testing.assert_allclose(prior[N_BOUNDARY:], photo()[state.points[:, 1], state.points[:, 0]] / 255)
    assert len(set(pull[:N_BOUNDARY])) == len(set(pull[N_BOUNDARY:])) == 1


def test_density_is_how_many_colours_there_are_for_a_pixel() -> None:
    state = begun()
    state.seed(5.0)
    assert state.density == (N_BOUNDARY + len(state.points)) / N_PIXELS > N_BOUNDARY / N_PIXELS


def test_it_can_be_compared_with_another_picture() -> None:
    state = state_of()
    other = np.full((N_PIXELS, 3), 0.25, np.float32)
    state.compare_with(other)
    state.begin()
    assert state.truth is other
    assert_true(state)
    assert np.abs(shown(state) - other).mean() < 0.02


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4])
def test_points_can_be_spared_for_as_much_as_the_error_may_rise(share: float) -> None:
    state = begun()
    state.mse = 5.0 / (1 + RISE * share)
    assert state.spare == pytest.approx(share)
    state.mse = 6.0
    assert state.spare == 0.0
    state.lack = 6.0 - 5.0 / (1 + RISE * share)
    assert state.spare == pytest.approx(share)


def test_a_round_places_no_more_than_it_may() -> None:
    state = begun(aim=0.1)
    state.seed(200.0)
    for _ in range(3):
        before = len(state.points)
        state._place(0.0, 0.5, 0.0)
        assert before < len(state.points) <= 1.5 * before + FIRST_POINTS * N_PIXELS + 4


def test_regions_fill_up_to_their_bound() -> None:
    state = begun(aim=0.1, max_points=6)
    assert not state.has_full_region
    while state.catch_up():
        pass
    count = np.bincount(state.canvas.patch_of_points())
    assert count.max() == 6
    assert state.has_full_region
    assert (state._room() == 6 - state._points_by_region()).all()
    assert state.lack > 0
    assert state.open_mse == state.mse - state.lack


def test_iterations_are_told_with_what_has_grown() -> None:
    made: list[Iteration] = []
    state = state_of(on_iteration=made.append)
    state.begin()
    state.seed(20.0)
    seeded = set(state.canvas.patch_of_points().tolist())
    state.left = 3
    state.exchange(0.1)
    assert [one.number for one in made] == [1, 2, 3]
    assert [one.left for one in made] == [None, None, 3]
    assert made[0].grown == frozenset()
    assert made[1].grown == seeded
    last = made[-1]
    assert (last.points, last.mse) == (len(state.points), state.mse)
    assert last.worst_error == pytest.approx(255 * np.abs(state.residual).max())
    square = (state.residual**2).sum(axis=1)
    by_region = np.bincount(state.foundation.geometry.patch_at().ravel(), square)
    assert last.worst_region == by_region.argmax()


def test_it_goes_on_where_others_have_begun() -> None:
    first = begun()
    first.seed(5.0)
    made: list[Iteration] = []
    start = Start(first.points, first.colors, 4, 0.5)
    again = state_of(start=start, on_iteration=made.append)
    again.begin()
    assert [one.number for one in made] == [5]
    assert again.lack == 0.5
    np.testing.assert_array_equal(again.points, first.points)
    assert again.mse <= first.mse * (1 + 1e-4)


def crowd(state: Refinement, n: int) -> None:
    """Add so many points, wherever there is room."""
    known = {tuple(point) for point in state.points.tolist()}
    more = [p for p in some_points(state.foundation, 2 * n).tolist() if tuple(p) not in known]
    state._insert(np.array(more[:n]))


def test_points_that_bring_nothing_are_taken_back() -> None:
    """In a picture that needs none at all."""
    state = state_of(pixels=np.full((70, 90, 3), 99, np.uint8))
    state.begin()
    crowd(state, 250)
    few, residual = state.points, state.residual.copy()
    state._remember()
    crowd(state, 900)
    assert len(state.points) > 1000
    state.residual = residual  # as if they had changed nothing
    assert state.fall_back()
    assert len(state.points) <= len(few)
    assert_true(state)


def test_points_that_are_worth_it_stay() -> None:
    """Where waves are so high that every region wants some."""
    state = state_of(pixels=photo(30))
    state.begin()
    state._remember()
    state.grow(3.0, early=False)
    grown = state.points
    assert not state.fall_back()
    assert state.points is grown


def test_without_anything_better_there_is_no_way_back() -> None:
    assert not begun().fall_back()


@pytest.mark.parametrize(("better", "goes"), [(0.999, True), (1.001, False)])
def test_a_bargain_is_taken_only_if_it_is_better_after_its_last_fit(better: float, goes: bool) -> None:
    state = begun()
    now = state._bargains(state._square_errors())
    state._best = now._replace(score=better * now.score / SETTLED)
    state.lack = 0.25
    assert state.fall_back() is goes
    assert state.lack == (0.0 if goes else 0.25)


def test_only_regions_that_have_a_better_bargain_go_back() -> None:
    state = begun()
    state.grow(3.0, early=False)
    now = state._bargains(state._square_errors())
    region = int(np.bincount(now.region).argmax())
    others = now.region != region
    score = np.where(np.arange(len(now.score)) == region, 0.5, 2.0) * now.score
    state._best = Bargains(score, now.points[others], now.colors[others], now.region[others])
    kept = state.points[others]
    assert state.fall_back()
    np.testing.assert_array_equal(state.points, kept)
    assert_true(state)


def test_the_best_bargain_of_each_region_is_remembered() -> None:
    state = begun()
    area = np.bincount(state.foundation.geometry.patch_at().ravel())
    first, then = np.ones(len(area)), np.linspace(0.5, 1.5, len(area))
    for state._squares in (first, then):
        state._remember()
    assert state._best is not None
    without_points = np.zeros((0, 2), np.int64), np.zeros((0, 3)), np.zeros(0, np.int64)
    expected = bargains(np.minimum(first, then), area, *without_points)
    np.testing.assert_allclose(state._best.score, expected.score)


def test_fit_and_residual_are_let_go_while_points_change(monkeypatch: pytest.MonkeyPatch) -> None:
    """They are large: neither is there while points are placed, nor while a new mesh is laid."""
    state = begun()
    state.seed(5.0)
    held = []

    def watched(real: Callable[..., Any], *arguments: Any) -> Any:
        held.append({"fit", "residual"} & vars(state).keys())
        return real(*arguments)

    for name in ("begin_placement", "lay_unfolded_canvas"):
        monkeypatch.setattr(state_module, name, partial(watched, getattr(state_module, name)))
    state.exchange(0.1)
    assert held == [set(), set()]
    assert_true(state)


class Scripted(Refinement):
    """A state whose rounds end as a test says: with so many points, such an error, and whether more help.

    asked  share, growth and expected error of each round
    """

    aim = 1.0

    def __init__(self, *rounds: tuple[int, float, bool], points: int = 0, mse: float = 100.0) -> None:
        self.points, self.mse, self.lack, self.bias = np.zeros((points, 2), np.int64), mse, 0.0, 1.0
        self.truth = np.zeros((40_000, 3), np.float32)
        self.rounds = list(rounds)
        self.asked: list[tuple[float, float, float]] = []

    def _place(self, share: float, growth: float, expected: float) -> bool:
        self.asked.append((share, growth, expected))
        n, self.mse, more = self.rounds.pop(0)
        self.points = np.zeros((n, 2), np.int64)
        return more


def test_growth_ends_near_the_aim() -> None:
    """Here it is 1."""
    state = Scripted((10, NEAR + 0.01, True), (20, NEAR, True))
    assert state.grow(3.0, early=True)
    assert state.asked == [(0.0, 3.0, pytest.approx(1 / SETTLED))] * 2
    assert Scripted(mse=NEAR).grow(3.0, early=True)


def test_growth_ends_where_no_more_points_help() -> None:
    assert not Scripted((10, 50.0, True), (11, 40.0, False)).grow(3.0, early=False)


@pytest.mark.parametrize(("points", "change", "goes_on"), [(10, 1, False), (10, -1, True), (11, 1, True)])
def test_growth_ends_with_a_round_that_changes_nothing(points: int, change: int, goes_on: bool) -> None:
    """It takes points, or an error that falls by a hundredth."""
    rounds = [(10, 50.0, True), (points, 50.0 * LEAST_CHANGE + 0.01 * change, True), (99, 1.0, True)]
    state = Scripted(*rounds)
    assert state.grow(3.0, early=False) is goes_on
    assert len(state.asked) == 2 + goes_on


def test_with_many_points_growth_leaves_the_rest_to_exchanges() -> None:
    state = Scripted((FEW, EARLY_NEAR + 0.01, True), (FEW + 1, EARLY_NEAR, True))
    assert state.grow(3.0, early=True)
    assert [expected for *_, expected in state.asked] == [1 / SETTLED, EARLY / SETTLED]
    late = Scripted((FEW, EARLY_NEAR, True), (FEW + 1, NEAR, True))
    assert late.grow(3.0, early=False)
    assert [expected for *_, expected in late.asked] == [1 / SETTLED] * 2


def idle(n: int, mse: float, growth: float = 1.5) -> tuple[int, float]:
    """So many times the points, and an error that has fallen a little less than they are worth."""
    return int(growth * n), mse * (growth - 0.01) ** -LEAST_RETURN


def test_a_crowd_that_brings_little_twice_in_a_row_is_enough() -> None:
    n, mse = int(CROWDED * 40_000) + 1, 50.0
    once, twice = idle(n, mse), idle(*idle(n, mse))
    state = Scripted((*once, True), (*twice, True), points=n, mse=mse)
    assert not state.grow(3.0, early=False)
    assert state.rounds == []


def test_a_round_that_helps_makes_good_for_one_before_that_did_not() -> None:
    n, mse = int(CROWDED * 40_000) + 1, 50.0
    once = idle(n, mse)
    helped = once[0] * 2, once[1] / 2
    state = Scripted(
        (*once, True), (*helped, True), (*idle(*helped), True), (90_000, 1.0, True), points=n, mse=mse
    )
    assert state.grow(3.0, early=False)
    assert state.rounds == []


def test_few_points_may_bring_little() -> None:
    state = Scripted((150, 49.0, True), (225, 48.0, True), (340, 47.0, True), (400, 1.0, True), points=100)
    assert state.grow(3.0, early=False)


def test_an_exchange_puts_no_more_in_than_so_many_times_what_it_takes_out() -> None:
    state = Scripted(*[(10, 1.0, True)] * 3, mse=1.0)
    state.bias = 1.5
    assert state.exchange(0.2)
    assert state.exchange(0.0)
    assert state.catch_up()
    assert [asked[:2] for asked in state.asked] == [(0.2, 0.2 * REPLACEMENT), (0.0, GROWTH), (0.0, GROWTH)]
    # Only growth believes that errors come out lower than placement foresees.
    assert [asked[2] for asked in state.asked] == pytest.approx([1 / SETTLED, 1.5 / SETTLED, 1.0])
