"""Placing points: what is claimed of the error holds, and threads do not matter."""

from __future__ import annotations

import numpy as np
import pytest

from gcvec.greedy import begin
from gcvec.greedy.colors import usefulness
from gcvec.greedy.placement import LEAST_COVER, LEAST_MARGIN, _grow, _least, look_everywhere
from gcvec.greedy.queues import Queue
from gcvec.greedy.strip import CANDIDATES, ENTRIES, VERTICES, Strip
from gcvec.parallel import use_workers
from gcvec.patches.mesh import jitter
from tests.gcvec.greedy.gardens import (
    PULL,
    Garden,
    alive,
    garden,
    garden_on,
    painted,
    triangle_keys,
    whole_vertices,
)
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


def gain_of(strip: Strip, t: int, e: int) -> float:
    """What a point at an entry of a triangle would save."""
    own = np.arange(strip.first[t], strip.last[t])
    area = strip.weights[own].sum(axis=1).astype(float)
    q = strip.weights[e] / strip.weights[e].sum()
    phi = np.maximum((strip.weights[own] / q).min(axis=1), 0)
    pressure = (phi[:, None] * strip.residual[strip.pixel[own]]).sum(axis=0)
    return float((pressure**2).sum() / (1e-12 + (phi**2 / area).sum()))


def test_of_a_large_triangle_the_worst_pixels_are_tried() -> None:
    """Of equally bad ones the first; those that can have no point are none of them."""
    start = garden("ring", 60)
    (strip,) = start.placement.strips
    seats = start.placement._seats
    strip.residual[:] = np.round(4 * strip.residual) / 4  # many are equally bad
    look_everywhere(strip, seats, 0.0)
    large = [t for t in alive(strip) if strip.last[t] - strip.first[t] > 40]
    assert len(large) > 20
    for t in large:
        own = np.arange(strip.first[t], strip.last[t])
        at = seats.under[strip.pixel[own] + strip.first_row * strip.width]
        free = ~seats.taken[at] & (seats.patch[at] == strip.patch[t])
        able = own[free & (strip.weights[own].sum(axis=1) >= LEAST_COVER)]
        square = (strip.residual[strip.pixel[able]].astype(float) ** 2).sum(axis=1)
        tried = able[np.argsort(-square, kind="stable")[:CANDIDATES]]
        share = strip.weights[tried] / strip.weights[tried].sum(axis=1, keepdims=True)
        gains = [gain_of(strip, t, e) for e in tried[share.min(axis=1) >= LEAST_MARGIN]]
        assert strip.gain[t] == pytest.approx(max(gains, default=0.0), rel=1e-3, abs=1e-6)


def looked_at(start: Garden) -> tuple[Strip, np.ndarray]:
    """The strip of a placement, and its triangles where a point saves something, the best first."""
    (strip,) = start.placement.strips
    look_everywhere(strip, start.placement._seats, 0.0)
    triangles = alive(strip)
    useful = triangles[strip.gain[triangles] > 0]
    return strip, useful[np.argsort(-strip.gain[useful])]


def plenty(start: Garden) -> np.ndarray:
    return np.full(len(start.foundation.network.loops), 1000)


def test_a_triangle_that_has_changed_waits() -> None:
    start = garden("voronoi", 60)
    strip, useful = looked_at(start)
    before = int(strip.counts[VERTICES])
    room = plenty(start)
    _grow(strip, start.placement._seats, np.repeat(useful[:1], 3), room, PULL)
    assert strip.counts[VERTICES] == before + 1
    assert room.sum() == plenty(start).sum() - 1
    around = [t for t in alive(strip) if before in strip.triangles[t]]
    assert len(around) >= 3
    assert (strip.gain[around] == 0).all()


def test_each_point_takes_its_patchs_room_and_its_seat() -> None:
    start = garden("quadrants", 60)
    strip, useful = looked_at(start)
    seats = start.placement._seats
    before, taken = int(strip.counts[VERTICES]), seats.taken.copy()
    room = np.array([2, 0, 5, 1000])
    _grow(strip, seats, useful, room, PULL)
    new = np.arange(before, strip.counts[VERTICES])
    used = np.bincount(seats.patch[strip.seat[new]], minlength=4)
    assert used[:3].tolist() == [2, 0, 5]
    assert room.tolist() == [0, 0, 0, 1000 - used[3]]
    assert not taken[strip.seat[new]].any()
    assert np.flatnonzero(seats.taken & ~taken).tolist() == sorted(strip.seat[new])


def test_a_part_of_a_picture_puts_points_where_the_whole_one_does() -> None:
    """The hash that moves a point off its pixel's centre is that of the pixel in the whole picture."""
    start = garden("voronoi", 60)
    strip, useful = looked_at(start)
    v = int(strip.counts[VERTICES])
    part = start.placement._seats._replace(column=512, row=256)
    _grow(strip, part, useful[:1], plenty(start), PULL)
    pixel = np.array([[strip.seat[v] % strip.width, strip.seat[v] // strip.width]], np.int64)
    np.testing.assert_allclose(strip.domain[v], jitter(pixel, (512, 256))[0], rtol=0, atol=1e-9)
    assert np.abs(strip.domain[v] - jitter(pixel)[0]).max() > 1e-3


def test_those_that_go_are_the_least_useful() -> None:
    start = garden("quadrants", 200)
    (strip,) = start.placement.strips
    use = np.array([usefulness(strip, v) for v in whole_vertices(strip)])
    seat = strip.seat[whole_vertices(strip)].copy()
    start.placement.thin_out(0.25)
    gone = ~np.isin(seat, strip.seat[: strip.counts[VERTICES]])
    assert gone.sum() <= int(0.25 * len(use))
    assert use[gone].max() <= np.sort(use)[int(0.25 * len(use)) - 1]


@pytest.mark.parametrize(("share", "least"), [(0.0, -np.inf), (0.24, -np.inf), (0.25, 1), (0.5, 2), (1.0, 4)])
def test_the_limit_is_the_most_useful_one_of_a_share(share: float, least: float) -> None:
    assert _least(np.array([3.0, 1.0, 4.0, 2.0]), share) == least


def test_the_best_of_a_queue_exceed_the_threshold_and_fit_into_their_patches() -> None:
    placement = garden("quadrants", 40, left=2).placement
    gain, patch = np.array([3.0, 9.0, 5.0, 9.0, 2.0]), np.array([0, 0, 0, 1, 1], np.int32)
    queue = Queue(np.arange(5) * 10, gain, patch, np.array([2, 0, 1, 0, 1]))
    assert placement._best(queue).tolist() == [10, 30, 20, 40]
    placement._threshold = 2.0
    assert placement._best(queue).tolist() == [10, 30, 20]
    placement._room = None
    placement._threshold = 0.0
    assert placement._best(queue).tolist() == [10, 30, 20, 0, 40]


def test_ranks_count_the_better_ones_of_a_patch_in_all_strips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(begin, "TRIANGLES_A_STRIP", 100)
    placement = garden("ring", 300, left=50).placement
    queues, full = placement._queues()
    assert len(queues) == 4
    assert not len(full.square)
    gain, patch, rank = (
        np.concatenate([getattr(q, name) for q in queues]) for name in ("gain", "patch", "rank")
    )
    better = (gain[None] > gain[:, None]) & (patch[None] == patch[:, None])
    as_good = (gain[None] == gain[:, None]) & (patch[None] == patch[:, None])
    assert (better.sum(axis=1) <= rank).all()
    assert (rank < (better | as_good).sum(axis=1)).all()


def test_full_patches_are_told_by_their_error_price_and_area() -> None:
    start = garden("quadrants", 40, left=5)
    placement, patch = start.placement, start.foundation.geometry.patch_at().ravel()
    assert placement._room is not None
    placement._room[1] = placement._room[3] = 0
    queues, full = placement._queues()
    (strip,) = placement.strips
    assert set(queues[0].patch.tolist()) == {0, 2}
    own = slice(strip.first_row * strip.width, (strip.first_row + strip.rows) * strip.width)
    square = np.bincount(patch[own], (strip.residual.astype(float) ** 2).sum(axis=1))
    np.testing.assert_allclose(full.square, square[[1, 3]], rtol=1e-5)
    assert full.area == pytest.approx(np.isin(patch, [1, 3]).mean())
    for p, price in zip((1, 3), full.price, strict=True):
        own_triangles = [t for t in alive(strip) if strip.patch[t] == p]
        assert price == strip.gain[own_triangles].max()
