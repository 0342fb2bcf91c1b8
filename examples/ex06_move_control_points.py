"""Shapes change by moving the control points of curves (paper, Fig. 10): a ball becomes a pear.

Parameter domains and coordinates stay; the patches on both sides of the curve follow.
"""

from __future__ import annotations

import numpy as np

from examples import figures
from examples.ex04_stages import polygons
from examples.scenes import BALLS, vectorized_balls
from gcvec import VectorImage
from gcvec.edit import Move, edit


def outline_of(image: VectorImage, x: float, y: float, radius: float) -> int:
    """The closed curve that runs around a circle."""
    off = [
        np.abs(np.hypot(*(c.control_points - [x, y]).T) - radius).max() if c.closed else np.inf
        for c in image.curves
    ]
    return int(np.argmin(off))


def main() -> dict[str, float]:
    """How far control points moved, what folded over, and how much of the picture changed."""
    image, ball = vectorized_balls(), BALLS[0]
    curve = outline_of(image, ball.x, ball.y, ball.radius)
    moves = []
    for k, (x, y) in enumerate(image.curves[curve].control_points):
        up = np.clip((ball.y - y) / ball.radius, 0, 1)
        moves.append(Move(curve, k, -0.45 * up * (x - ball.x), -12 * up**2))
    edited = edit(image, moves)
    changed = (image.render() != edited.render()).any(axis=2)
    figures.save("move_control_points", [[image.render(), polygons(image), edited.render()]])
    return {
        "largest move": max(float(np.hypot(m.dx, m.dy)) for m in moves),
        "foldovers": edited.foldovers,
        "changed": float(changed.mean()),
    }


if __name__ == "__main__":
    print(main())
