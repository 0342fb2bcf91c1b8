"""Steps across borders: against a slow reading of the profile, and where the truth is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import ndimage, optimize

from gcvec.borders.profile import (
    ALONG,
    BEYOND,
    FLANK,
    LARGEST_RAMP,
    LARGEST_SPREAD,
    LEAST_STEP,
    REACH,
    SURE_STEP,
    UNEVEN,
    step_shifts,
)

OFFSETS = np.linspace(-REACH, REACH, 21)
FLANKS = OFFSETS <= -FLANK, OFFSETS >= FLANK
RIGHT = np.array([[1.0, 0.0]])
BROAD, RIGHT_THIN, LEFT_THIN, THIN = (np.array([sides], bool) for sides in np.ndindex(2, 2))

Side = Callable[[float], np.ndarray]


def read(picture: np.ndarray, point: np.ndarray, normal: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """The colours `(n, 3)` so far along the normal."""
    x, y = (point + offsets[:, None] * normal).T - 0.5
    return np.stack(
        [ndimage.map_coordinates(picture[..., c], (y, x), order=1, mode="nearest") for c in range(3)], axis=1
    )


def slow_color_along(
    picture: np.ndarray, point: np.ndarray, normal: np.ndarray, offset: float, other: np.ndarray
) -> np.ndarray:
    """The colour furthest from the other along a line through the thin region."""
    along = read(picture, point + offset * normal, normal @ [[0, 1], [-1, 0]], np.arange(-ALONG, ALONG + 1.0))
    return np.asarray(along[((along - other) ** 2).sum(axis=1).argmax()])


def slow_thin_step(
    picture: np.ndarray,
    point: np.ndarray,
    normal: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    thin: np.ndarray,
) -> float:
    """The shift where one side is thin or both are."""
    profile = read(picture, point, normal, OFFSETS)
    half = len(profile) // 2
    left, right = profile[:half], profile[half + 1 :]
    away = ((left[:, None] - right[None]) ** 2).sum(axis=2)
    a, b = np.unravel_index(away.argmax(), away.shape)
    if thin.tolist() == [True, False]:
        a = ((left - high) ** 2).sum(axis=1).argmax()
        b = away[a].argmax()
    elif thin.tolist() == [False, True]:
        b = ((right - low) ** 2).sum(axis=1).argmax()
        a = away[:, b].argmax()
    near = slice(a, b + half + 2)
    low, high = profile[near][0], profile[near][-1]
    start, end = OFFSETS[near][0], OFFSETS[near][-1]
    if thin[0] and start > -0.9:
        low = slow_color_along(picture, point, normal, start, high)
    if thin[1] and end < 0.9:
        high = slow_color_along(picture, point, normal, end, low)
    share = (profile[near] - low) @ (high - low) / ((high - low) @ (high - low))
    return float(OFFSETS[near][-1] - np.trapezoid(np.clip(share, 0, 1), OFFSETS[near]))


def slow_step(
    picture: np.ndarray, point: np.ndarray, normal: np.ndarray, thin: np.ndarray
) -> tuple[float, float, float]:
    """Shift, trust and what shading adds, at one point."""
    profile = read(picture, point, normal, OFFSETS)
    low, high, spread = slow_sides(profile, 0)
    step = high(0) - low(0)
    if step @ step < 3 * LEAST_STEP**2:
        middle = profile[np.abs(OFFSETS) <= FLANK] - (low(0) + high(0)) / 2
        largest = (middle**2).sum(axis=1).max()
        line = largest >= 3 * SURE_STEP**2 and spread <= LARGEST_SPREAD**2 * largest
        at = slow_thin_step(picture, point, normal, low(0), high(0), thin) if thin.any() and line else np.nan
        return at, UNEVEN * line, np.nan
    trust = min(np.sqrt(step @ step / 3) / SURE_STEP, 1.0)
    beyond = (read(picture, point, normal, np.array([-BEYOND, BEYOND])) - (low(0) + high(0)) / 2) @ step
    middle = profile[np.abs(OFFSETS) <= FLANK]
    away = np.minimum(*(((middle - side(0)) ** 2).sum(axis=1) for side in (low, high)))
    if thin.any() and (beyond[0] > 0 or beyond[1] < 0 or away.max() > step @ step):
        return slow_thin_step(picture, point, normal, low(0), high(0), thin), trust * UNEVEN, np.nan
    if spread > LARGEST_SPREAD**2 * step @ step:
        return np.nan, trust * UNEVEN, np.nan
    share = (profile - low(0)) @ step / (step @ step)
    flat = REACH - np.trapezoid(np.clip(share, 0, 1), OFFSETS)
    low, high, spread = slow_sides(profile, 1)
    step = high(0) - low(0)
    ramp = np.maximum(*(np.abs(side((REACH + FLANK) / 2) - side(0)) for side in (low, high)))
    if (
        step @ step < 3 * LEAST_STEP**2
        or max(spread, ramp @ ramp * (LARGEST_SPREAD / LARGEST_RAMP) ** 2) > LARGEST_SPREAD**2 * step @ step
    ):
        return flat, trust, np.nan
    area = np.trapezoid(profile, OFFSETS, axis=0) @ step

    def excess(at: float) -> float:
        near, far = (low(at) + low(-REACH)) / 2 * (at + REACH), (high(at) + high(REACH)) / 2 * (REACH - at)
        return float((near + far) @ step - area)

    return flat, trust, optimize.brentq(excess, -REACH, REACH) - flat


def slow_sides(profile: np.ndarray, degree: int) -> tuple[Side, Side, float]:
    """Both sides' colours as polynomials of the distance, and the mean squared distance of the samples."""
    fits = [np.polyfit(OFFSETS[own], profile[own], degree) for own in FLANKS]
    low, high = (lambda s, fit=fit: np.array([np.polyval(f, s) for f in fit.T]) for fit in fits)
    off = [
        np.mean([((profile[k] - side(OFFSETS[k])) ** 2).sum() for k in np.flatnonzero(own)])
        for side, own in zip((low, high), FLANKS, strict=True)
    ]
    return low, high, float(np.mean(off))


def test_steps_as_read_out_loud() -> None:
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:30, :40] + 0.5
    picture = 0.4 + 0.004 * x[..., None] * rng.uniform(-1, 1, 3) + 0.02 * rng.normal(size=(30, 40, 3))
    picture += 0.2 * np.clip(x + 0.3 * y - 25, 0, 1)[..., None] * rng.uniform(-1, 1, 3)
    points = rng.uniform([-1, -1], [41, 31], (1000, 2))
    angle = rng.uniform(0, 2 * np.pi, 1000)
    normals = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    # Off the frame, where profiles are flat, there is no telling which of their samples is the furthest.
    within = ((points > 4) & (points < [36, 26])).all(axis=1)
    thin = (rng.random((1000, 2)) < 0.4) & within[:, None]
    slow = np.array([slow_step(picture, *one) for one in zip(points, normals, thin, strict=True)])
    fast = np.stack(step_shifts(picture, points, normals, thin), axis=1)
    assert np.isfinite(slow).sum(axis=0).min() > 20
    np.testing.assert_allclose(fast, slow, atol=1e-9)


@pytest.mark.parametrize("edge", [9.0, 9.2, 9.5, 9.9])
def test_a_step_between_shaded_sides_stays_where_it_is(edge: float) -> None:
    """The left side grows lighter towards the step: taken for flat, it would draw the step away."""
    fine = (np.arange(20 * 64) + 0.5) / 64
    profile = np.where(fine < edge, 0.3 + 0.03 * (fine - edge), 0.55).reshape(20, 64).mean(axis=1)
    picture = np.tile(profile[None, :, None], (9, 1, 3))
    at, at_flat = 9.4, 9.4
    for _ in range(3):
        shift, trust, shaded = step_shifts(picture, np.array([[at, 4.5]]), RIGHT, BROAD)
        at += shift[0] + shaded[0]
        at_flat += step_shifts(picture, np.array([[at_flat, 4.5]]), RIGHT, BROAD)[0][0]
        assert trust[0] == 1
    assert at == pytest.approx(edge, abs=0.025)
    assert abs(at_flat - edge) > 0.1


def test_no_step_no_shift() -> None:
    for thin in (BROAD, THIN):
        shift, trust, shaded = step_shifts(np.full((9, 9, 3), 0.5), np.array([[4.0, 4.0]]), RIGHT, thin)
        assert np.isnan([shift[0], shaded[0]]).all()
        assert trust[0] == 0


def test_a_line_of_broad_regions_is_seen_but_not_measured() -> None:
    """A line of one pixel: the border on either side stays where it was drawn, and is no matter of taste."""
    picture = np.full((9, 20, 3), 0.3)
    picture[:, 10] = 0.8
    for x in (10.0, 11.0):
        shift, trust, shaded = step_shifts(picture, np.array([[x, 4.5]]), RIGHT, BROAD)
        assert np.isnan([shift[0], shaded[0]]).all()
        assert trust[0] == UNEVEN


@pytest.mark.parametrize("width", [2.0, 2.5, 3.0, 3.4])
@pytest.mark.parametrize("start", [9.0, 9.3, 9.5, 9.8])
def test_both_borders_of_a_thin_region_are_measured(width: float, start: float) -> None:
    """Between sides of two colours, from half a pixel off either way."""
    fine = (np.arange(24 * 64) + 0.5) / 64
    inside = (fine >= start) & (fine < start + width)
    profile = np.where(inside, 0.8, np.where(fine < start, 0.3, 0.4)).reshape(24, 64).mean(axis=1)
    picture = np.tile(profile[None, :, None], (9, 1, 3))
    for edge, thin in ((start, RIGHT_THIN), (start + width, LEFT_THIN)):
        for off in (-0.5, 0.5):
            at = edge + off
            for _ in range(3):
                shift, trust, _ = step_shifts(picture, np.array([[at, 4.5]]), RIGHT, thin)
                assert trust[0] > 0
                at += shift[0]
            assert at == pytest.approx(edge, abs=0.06)


@pytest.mark.parametrize(("width", "off"), [(1.0, 0.16), (1.2, 0.15), (1.8, 0.06)])
def test_a_line_shows_its_whole_colour_somewhere_along_it(width: float, off: float) -> None:
    """It is aslant: here two pixels share it, there one is covered by it. By the colour of each profile alone
    the thinnest would be 0.23 pixels too wide on either side."""
    y, x = (np.mgrid[: 20 * 16, : 30 * 16] + 0.5) / 16
    across = (y - 10.2 - 0.25 * (x - 15)) / np.hypot(1, 0.25)
    fine = np.where(abs(across) < width / 2, 0.2, 0.8).reshape(20, 16, 30, 16).mean(axis=(1, 3))
    picture = np.repeat(fine[..., None], 3, axis=2)
    normal = np.array([-0.25, 1.0]) / np.hypot(1, 0.25)
    along = np.linspace(-6, 6, 25)[:, None] * [normal[1], -normal[0]]
    for side, thin in ((-1, RIGHT_THIN), (1, LEFT_THIN)):
        points = [15, 10.2] + side * width / 2 * normal + along
        normals, sides = np.tile(normal, (25, 1)), np.repeat(thin, 25, axis=0)
        shift, _, _ = step_shifts(picture, points, normals, sides)
        assert abs(shift.mean()) < off
