"""Where across a line the photo changes from one side's colour to the other's."""

from __future__ import annotations

import numpy as np

from gcvec.kernels import kernel

REACH = 2.5
"""The profile is read this far to either side, pixels. On true circles borders come within 0.015 to 0.03
pixels by it, root mean square, where the label map alone gives 0.03 to 0.09."""

FLANK = 1.5
"""From here on, pixels off the line, it shows nothing but a side's own colour."""

SPACING = 0.25
"""Of a profile's samples, pixels."""

LEAST_STEP, SURE_STEP = 0.02, 0.06
"""Distances between the colours of both sides, of colours in [0, 1], below which a step is not trusted, and
above which it is wholly."""

LARGEST_SPREAD = 0.25
"""How far a side's own colours may spread, as a share of the step."""

LARGEST_RAMP = 0.5
"""By how much of the step a side's colour may change between the line and its flank, to be taken for
shading."""

UNEVEN = 0.3
"""What a sample counts where uneven sides hide where between two pixel centres the step lies."""

BEYOND = 3.5
"""So far off the line, pixels, the colour beside a thin side must have turned back: else the blur of its
other border does not reach the flank."""

LEAST_HALF, ALONG = 0.9, 3
"""Where it is no further than this to half-way through a thin region, pixels, no pixel need show its whole
colour; one will so many pixels either way along it."""

_PER_SIDE, _FLANK = round(REACH / SPACING), round(FLANK / SPACING)


@kernel
def color_at(picture, x, y, out):
    """Bilinear interpolation between pixel centres, clamped at the frame."""
    height, width = picture.shape[:2]
    x = min(max(x - 0.5, 0.0), width - 1.0)
    y = min(max(y - 0.5, 0.0), height - 1.0)
    x0, y0 = min(int(x), max(width - 2, 0)), min(int(y), max(height - 2, 0))
    x1, y1 = min(x0 + 1, width - 1), min(y0 + 1, height - 1)
    s, t = x - x0, y - y0
    for c in range(picture.shape[2]):
        top = (1 - s) * picture[y0, x0, c] + s * picture[y0, x1, c]
        bottom = (1 - s) * picture[y1, x0, c] + s * picture[y1, x1, c]
        out[c] = (1 - t) * top + t * bottom


@kernel
def _line_through(profile, sign, sloped, color, slope):
    """A side's colour on the line and its change a pixel, by least squares through the samples of the
    flank on the side `sign`; without a slope their mean. Returns the mean squared distance of the samples."""
    n = _PER_SIDE - _FLANK + 1
    middle = sign * (REACH + FLANK) / 2
    spread = 0.0
    for c in range(3):
        mean, along, square = 0.0, 0.0, 0.0
        for k in range(_FLANK, _PER_SIDE + 1):
            s = sign * k * SPACING - middle
            mean += profile[_PER_SIDE + sign * k, c] / n
            along += s * profile[_PER_SIDE + sign * k, c]
            square += s * s
        slope[c] = along / square if sloped else 0.0
        color[c] = mean - slope[c] * middle
        for k in range(_FLANK, _PER_SIDE + 1):
            off = profile[_PER_SIDE + sign * k, c] - color[c] - slope[c] * sign * k * SPACING
            spread += off * off / n
    return spread


@kernel
def _sides(profile, sloped, low, low_slope, high, high_slope):
    """Both sides' lines; returns the squares of the step between them, of how far they spread and of how far
    they change between the line and their flanks."""
    spread = _line_through(profile, -1, sloped, low, low_slope)
    spread = (spread + _line_through(profile, 1, sloped, high, high_slope)) / 2
    step, ramp = 0.0, 0.0
    reach = (REACH + FLANK) / 2
    for c in range(3):
        step += (high[c] - low[c]) ** 2
        ramp += (reach * max(abs(low_slope[c]), abs(high_slope[c]))) ** 2
    return step, spread, ramp


@kernel
def _is_line(profile, low, high, spread):
    """Whether between even sides of one colour there is something of another: a line too thin for its borders
    to be told apart."""
    largest = 0.0
    for k in range(_PER_SIDE - _FLANK, _PER_SIDE + _FLANK + 1):
        square = 0.0
        for c in range(3):
            square += (profile[k, c] - (low[c] + high[c]) / 2) ** 2
        largest = max(largest, square)
    return largest >= 3 * SURE_STEP**2 and spread <= LARGEST_SPREAD**2 * largest


@kernel
def _step_between(profile, first, last, low, high):
    """Where, between two of the profile's samples, the step is from a side of colour `low` to one of `high`:
    the far one's share, integrated, is the length that lies beyond it."""
    beyond, step = 0.0, max(_square(low, high), 1e-12)
    for k in range(first, last + 1):
        share = 0.0
        for c in range(3):
            share += (profile[k, c] - low[c]) * (high[c] - low[c])
        weight = SPACING / 2 if k in (first, last) else SPACING
        beyond += min(max(share / step, 0.0), 1.0) * weight
    return (last - _PER_SIDE) * SPACING - beyond


@kernel
def _shaded_step(profile, low, low_slope, high, high_slope):
    """Where the step is between two lines that have the profile's integral, which blur does not change."""
    missing, step, growth = 0.0, 0.0, 0.0
    for c in range(3):
        height = high[c] - low[c]
        integral = REACH * (low[c] + high[c]) + REACH**2 / 2 * (high_slope[c] - low_slope[c])
        for k in range(2 * _PER_SIDE + 1):
            integral -= profile[k, c] * _weight(k)
        missing += integral * height
        step += height * height
        growth += (high_slope[c] - low_slope[c]) * height
    # step * at + growth * at² / 2 = missing
    root = np.sqrt(max(step * step + 2 * growth * missing, 0.0))
    return min(max(2 * missing / (step + root), -REACH), REACH)


@kernel
def _turns_back(picture, point, normal, low, high):
    """Whether `BEYOND` one side the colour is nearer to the other side's."""
    color = np.empty(3)
    for sign in (-1, 1):
        color_at(picture, point[0] + sign * BEYOND * normal[0], point[1] + sign * BEYOND * normal[1], color)
        own = 0.0
        for c in range(3):
            own += sign * (color[c] - (low[c] + high[c]) / 2) * (high[c] - low[c])
        if own < 0:
            return True
    return False


@kernel
def _stands_out(profile, low, high):
    """Whether between the flanks there is a colour further from both than they are from each other."""
    step = _square(low, high)
    for k in range(_PER_SIDE - _FLANK, _PER_SIDE + _FLANK + 1):
        if min(_square(profile[k], low), _square(profile[k], high)) > step:
            return True
    return False


@kernel
def _thin_step(picture, point, normal, profile, low, high, thin):
    """Where the step is between the colours of two sides of which one, or both, are `thin` `(2,)`.

    A side too thin for a flank shows most of its own colour half-way through it; if it is not even a pixel
    to there, somewhere along it. So far its profile is that of a step, and the integral of its share tells
    where.
    """
    if thin[0] and thin[1]:
        first, last = _furthest_pair(profile)
    elif thin[0]:
        first = _furthest(profile, high, 0, _PER_SIDE)
        last = _furthest(profile, profile[first], _PER_SIDE + 1, 2 * _PER_SIDE + 1)
    else:
        last = _furthest(profile, low, _PER_SIDE + 1, 2 * _PER_SIDE + 1)
        first = _furthest(profile, profile[last], 0, _PER_SIDE)
    low, high = profile[first], profile[last]
    if thin[0] and (_PER_SIDE - first) * SPACING < LEAST_HALF:
        low = _color_along(picture, point, normal, first - _PER_SIDE, high)
    if thin[1] and (last - _PER_SIDE) * SPACING < LEAST_HALF:
        high = _color_along(picture, point, normal, last - _PER_SIDE, low)
    return _step_between(profile, first, last, low, high)


@kernel
def _color_along(picture, point, normal, k, other):
    """The colour furthest from the `other` along a thin region whose profile turns back at its sample k."""
    color, furthest, largest = np.empty(3), np.empty(3), -1.0
    x, y = point[0] + k * SPACING * normal[0], point[1] + k * SPACING * normal[1]
    for s in range(-ALONG, ALONG + 1):
        color_at(picture, x - s * normal[1], y + s * normal[0], color)
        square = _square(color, other)
        if square > largest:
            largest = square
            furthest[:] = color
    return furthest


@kernel
def _furthest_pair(profile):
    """The samples, one on either side of the line, whose colours are furthest from each other."""
    largest, first, last = 0.0, 0, 2 * _PER_SIDE
    for a in range(_PER_SIDE):
        b = _furthest(profile, profile[a], _PER_SIDE + 1, 2 * _PER_SIDE + 1)
        square = _square(profile[a], profile[b])
        if square > largest:
            largest, first, last = square, a, b
    return first, last


@kernel
def _furthest(profile, color, start, stop):
    """The sample from `start` to `stop` whose colour is furthest from this one."""
    furthest, largest = start, 0.0
    for k in range(start, stop):
        square = _square(profile[k], color)
        if square > largest:
            furthest, largest = k, square
    return furthest


@kernel
def _square(a, b):
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@kernel
def _weight(k):
    """Of a sample in an integral over the profile."""
    return SPACING / 2 if k == 0 or k == 2 * _PER_SIDE else SPACING


@kernel
def step_shifts(picture, points, normals, thin):
    """How far along its normal from each point the step is, how surely there is a step near, in [0, 1], and
    by how much more if both sides go on changing up to the step as they change beside it.

    NaN where that cannot be told: the sides are too much alike, or too uneven. Those whose region is `thin`
    there, `(n, 2) bool`, the near and the far one, need not be even.
    """
    profile = np.empty((2 * _PER_SIDE + 1, 3))
    low, high, low_slope, high_slope = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    n = len(points)
    shift, trust, shaded = np.full(n, np.nan), np.zeros(n), np.full(n, np.nan)
    for i in range(n):
        for k in range(-_PER_SIDE, _PER_SIDE + 1):
            x = points[i, 0] + k * SPACING * normals[i, 0]
            y = points[i, 1] + k * SPACING * normals[i, 1]
            color_at(picture, x, y, profile[k + _PER_SIDE])
        step, spread, _ = _sides(profile, False, low, low_slope, high, high_slope)
        if step < 3 * LEAST_STEP**2:
            if _is_line(profile, low, high, spread):
                trust[i] = UNEVEN
                if thin[i, 0] or thin[i, 1]:
                    shift[i] = _thin_step(picture, points[i], normals[i], profile, low, high, thin[i])
            continue
        trust[i] = min(np.sqrt(step / 3) / SURE_STEP, 1.0)
        if thin[i, 0] or thin[i, 1]:
            back = _turns_back(picture, points[i], normals[i], low, high)
            if back or _stands_out(profile, low, high):
                trust[i] *= UNEVEN
                shift[i] = _thin_step(picture, points[i], normals[i], profile, low, high, thin[i])
                continue
        if spread > LARGEST_SPREAD**2 * step:
            trust[i] *= UNEVEN
            continue
        shift[i] = _step_between(profile, 0, 2 * _PER_SIDE, low, high)
        step, spread, ramp = _sides(profile, True, low, low_slope, high, high_slope)
        even = ramp <= LARGEST_RAMP**2 * step and spread <= LARGEST_SPREAD**2 * step
        if step >= 3 * LEAST_STEP**2 and even:
            shaded[i] = _shaded_step(profile, low, low_slope, high, high_slope) - shift[i]
    return shift, trust, shaded
