"""Samples and parameter polygons as section 7 of `docs/format.md` describes them, in plain Python."""

from __future__ import annotations

import math
from collections.abc import Sequence

Place = tuple[float, float]


def plain_sample(control: Sequence[Sequence[float]], closed: bool, u: float) -> Place:
    m = len(control) if closed else len(control) - 3
    t = [float(i - 3) if closed else float(min(max(i - 3, 0), m)) for i in range(m + 7)]
    s = min(math.floor(u), m - 1)
    w = [1.0, 0.0, 0.0, 0.0]
    for j in range(1, 4):
        saved = 0.0
        for r in range(j):
            above, below = t[s + 4 + r] - u, u - t[s + 4 - j + r]
            ratio = w[r] / (above + below)
            w[r] = saved + above * ratio
            saved = below * ratio
        w[j] = saved
    P = [control[(s + k) % len(control)] for k in range(4)]
    x, y = (((w[0] * P[0][c] + w[1] * P[1][c]) + w[2] * P[2][c]) + w[3] * P[3][c] for c in range(2))
    return x, y


def plain_polygon(samples: Sequence[Place], closed: bool, level: int) -> list[int]:
    """Which samples of a curve are vertices."""
    tolerance = 2.0**-level if level < 8 else 0.0
    n = len(samples) - 1
    starts = [i * n // 3 for i in range(4)] if closed else [0, n]
    kept = set(starts)

    def split(a: int, b: int) -> None:
        farthest, where = tolerance, -1
        for i in range(a + 1, b):
            distance = distance_from_chord(samples[a], samples[b], samples[i])
            if distance > farthest:
                farthest, where = distance, i
        if where >= 0:
            kept.add(where)
            split(a, where)
            split(where, b)

    for a, b in zip(starts, starts[1:], strict=False):
        split(a, b)
    return sorted(kept)


def distance_from_chord(a: Place, b: Place, place: Place) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    ex, ey = place[0] - a[0], place[1] - a[1]
    square = dx * dx + dy * dy
    t = min(max((ex * dx + ey * dy) / square, 0.0), 1.0) if square > 0 else 0.0
    return math.hypot(ex - t * dx, ey - t * dy)
