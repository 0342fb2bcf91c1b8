"""Placing points: what is claimed of the error holds, and threads do not matter."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.greedy import begin
from gcvec.greedy.placement import look_everywhere
from gcvec.greedy.strip import ENTRIES, VERTICES
from gcvec.parallel import use_workers
from tests.gcvec.greedy.gardens import Garden, alive, garden, garden_on, painted, triangle_keys
from tests.gcvec.scenes import needle, no_points


def slow_gain(strip, seats, t: int) -> float:
    """The most that any pixel of a triangle saves, by the formula, one pixel after another."""
    own = np.arange(strip.first[t], strip.last[t])
    area = strip.weights[own].sum(axis=1).astype(float)
    pixel = strip.pixel[own]
    best = 0.0
    for e, a in zip(own, area, strict=True):
        seat = seats.under[strip.pixel[e] + strip.first_row * strip.width]
        q = strip.weights[e] / a
        if a < 0.3 or seats.taken[seat] or seats.patch[seat] != strip.patch[t] or q.min() < 0.02:
            continue
        phi = np.maximum((strip.weights[own] / q).min(axis=1), 0)
        pressure = (phi[:, None] * strip.residual[pixel]).sum(axis=0)
        best = max(best, float((pressure**2).sum() / (1e-12 + (phi**2 / area).sum())))
    return best


def test_gains_are_those_of_the_formula() -> None:
    start = garden("voronoi", 300)
    (strip,) = start.placement.strips
    seats = start.placement._seats
    look_everywhere(strip, seats, 0.0)
    for t in alive(strip)[::11]:
        assert strip.gain[t] <= slow_gain(strip, seats, t) * (1 + 1e-4) + 1e-9
        if strip.last[t] - strip.first[t] <= 8:  # all of its pixels are tried
            assert strip.gain[t] == pytest.approx(slow_gain(strip, seats, t), rel=1e-3, abs=1e-7)


@pytest.mark.parametrize("scene", ["ring", "voronoi"])
def test_the_error_is_that_of_the_picture_it_stands_for(scene: str) -> None:
    """Photo less picture stays true through points put in, taken out and coloured anew."""
    start = garden(scene, 100)
    height = len(start.photo) // start.placement.strips[0].width
    (strip,) = start.placement.strips
    rest = start.photo - painted(strip, height) - strip.residual  # borders are straight here
    assert start.placement.grow(0.4 * start.placement.error, 600)
    start.placement.thin_out(0.1)
    now = start.photo - painted(strip, height) - rest
    np.testing.assert_allclose(strip.residual, now, atol=2e-4)
    assert start.placement.error == pytest.approx((now**2).sum(), rel=1e-3)


def test_points_go_beside_a_patch_without_pixels_and_are_taken_out_there() -> None:
    start = garden_on(needle(), np.zeros((20, 40, 3), np.uint8), no_points())
    assert start.placement.grow(0.5 * start.placement.error, 300)
    start.placement.thin_out(0.5)
    points, *_ = start.placement.result()
    assert len(points) > 0


@pytest.mark.parametrize("left", [None, 100])
def test_where_the_best_triangles_take_no_point_the_next_ones_do(left: int | None) -> None:
    placement = garden("quadrants", 50, left).placement
    (strip,), seats, error = placement.strips, placement._seats, placement.error
    queues, _ = placement._queues()
    for t in queues[0].triangle[np.argsort(-queues[0].gain)[:5]]:
        seats.taken[seats.under[strip.best[t]]] = True  # as if another strip had a point there
    assert placement.grow(0.98 * error, 100)
    assert placement.error <= 0.985 * error


def test_points_reach_the_goal_and_no_two_share_a_pixel() -> None:
    start = garden("quadrants", 50)
    goal = 0.5 * start.placement.error
    assert start.placement.grow(goal, 3000)
    assert start.placement.error <= 1.01 * goal
    points, colors, new = start.placement.result()
    assert len(np.unique(points, axis=0)) == len(points) == len(colors)
    assert (np.lexsort((points[:, 0], points[:, 1])) == np.arange(len(points))).all()
    assert {tuple(p) for p in points[~new].tolist()} == {tuple(p) for p in start.points.tolist()}
    assert ((colors >= 0) & (colors <= 1)).all()


def test_the_least_useful_go_and_their_places_stay_empty() -> None:
    start = garden("quadrants", 200)
    start.placement.thin_out(0.25)
    left = {tuple(p) for p in start.placement.result()[0].tolist()}
    gone = {tuple(p) for p in start.points.tolist()} - left
    assert 40 <= len(gone) <= 50
    start.placement.grow(0.5 * start.placement.error, 500)
    assert not gone & {tuple(p) for p in start.placement.result()[0].tolist()}


def by_patch(start: Garden, points: np.ndarray) -> np.ndarray:
    patch = start.foundation.geometry.patch_at()[points[:, 1], points[:, 0]]
    return np.bincount(patch, minlength=len(start.foundation.network.loops))


def test_patches_keep_to_their_bound() -> None:
    start = garden("quadrants", 40, left=3)
    assert not start.placement.grow(0.0, 1000)
    points, _, new = start.placement.result()
    assert (by_patch(start, points[new]) == 3).all()


def test_what_full_patches_lack_is_not_asked_of_others() -> None:
    """One patch may have no more points: the others stop about where they would without that."""
    free, bound = garden("quadrants", 40), garden("quadrants", 40, left=2000)
    room = bound.placement._room
    assert room is not None
    room[0] = 0
    goal = 0.5 * free.placement.error
    for start in (free, bound):
        assert start.placement.grow(goal, 5000)
    assert free.placement.lack == 0
    assert free.placement.error <= 1.01 * goal
    assert bound.placement.error - bound.placement.lack <= 1.01 * goal
    counts = [by_patch(start, start.placement.result()[0]) for start in (free, bound)]
    assert counts[0][0] > counts[1][0]
    assert counts[1][0] == by_patch(bound, bound.points)[0]
    assert counts[1][1:].sum() == pytest.approx(counts[0][1:].sum(), rel=0.25)


def test_the_last_points_of_a_patch_go_where_they_save_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """And not to whichever strip comes first."""
    monkeypatch.setattr(begin, "TRIANGLES_A_STRIP", 100)
    start = garden("ring", 300, left=12)
    assert len(start.placement.strips) == 4
    start.placement.grow(0.0, 1000)
    points, _, new = start.placement.result()
    patch = start.foundation.geometry.patch_at()[points[:, 1], points[:, 0]]
    assert by_patch(start, points[new])[:2].tolist() == [12, 12]
    rows = points[new & (patch == 0), 1]
    assert rows.max() - rows.min() > 60


def test_full_patches_exchange_their_own_points() -> None:
    start = garden("quadrants", 200, left=0)
    before = by_patch(start, start.points)
    start.placement.thin_out(0.2)
    after = by_patch(start, start.placement.result()[0])
    np.testing.assert_allclose(before - after, 0.2 * before, atol=3)
    assert (start.placement._room == before - after).all()


def test_strips_and_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut into strips the picture gets as many points, the same ones with one thread as with two."""
    monkeypatch.setattr(begin, "TRIANGLES_A_STRIP", 100)
    results = []
    for workers in (1, 2):
        use_workers(workers)
        start = garden("ring", 300)
        assert len(start.placement.strips) == 4
        start.placement.grow(0.5 * start.placement.error, 2000)
        results.append(start.placement.result())
    for one, two in zip(*results, strict=True):
        np.testing.assert_array_equal(one, two)
    monkeypatch.undo()
    alone = garden("ring", 300)
    alone.placement.grow(0.5 * alone.placement.error, 2000)
    assert len(results[0][0]) == pytest.approx(len(alone.placement.result()[0]), rel=0.1)


def test_no_more_go_than_can() -> None:
    """No vertex that is no control point, and none about which triangles would fold."""
    start = garden("quadrants", 200)
    start.placement.thin_out(1.0)
    assert len(start.placement.result()[0]) < 0.2 * len(start.points)
    start.placement.thin_out(1.0)
    assert start.placement.error == pytest.approx(
        float((start.placement.strips[0].residual ** 2).sum()), rel=0.2
    )


@pytest.mark.parametrize("left", [None, 2000], ids=["any number", "bounded"])
@pytest.mark.parametrize("what", ["domain", "pixel"])
def test_a_strip_without_room_is_no_reason_to_give_up(what: str, left: int | None) -> None:
    """The next round has more."""
    made = garden("voronoi", 20, left)
    (strip,) = made.placement.strips
    used = strip.counts[{"domain": VERTICES, "pixel": ENTRIES}[what]]
    scarce = getattr(strip, what)[: used + {"domain": 4, "pixel": 1000}[what]]
    made.placement.strips = [strip._replace(**{what: scarce})]
    assert made.placement.grow(0.0, 1000)
    *_, new = made.placement.result()
    assert 0 < new.sum() < 100
    assert made.placement.error > 0


def test_gaps_that_triangles_leave_are_closed() -> None:
    """As many points are placed, and all is as true, as with room for everything that ever was."""
    ample, scarce = garden("voronoi", 20), garden("voronoi", 20)
    (strip,) = scarce.placement.strips
    room = strip.counts[ENTRIES] + 4 * len(strip.residual)
    tight = strip._replace(pixel=strip.pixel[:room], weights=strip.weights[:room])
    scarce.placement.strips = [tight]
    height = len(scarce.photo) // strip.width
    rest = scarce.photo - painted(tight, height) - tight.residual
    for made in (ample, scarce):
        assert made.placement.grow(0.0, 1000)
    assert ample.placement.strips[0].counts[ENTRIES] > room
    assert len(scarce.placement.result()[0]) == len(ample.placement.result()[0])
    assert triangle_keys(tight) == triangle_keys(ample.placement.strips[0])
    np.testing.assert_allclose(tight.residual, scarce.photo - painted(tight, height) - rest, atol=2e-4)
