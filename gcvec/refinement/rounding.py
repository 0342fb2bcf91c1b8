"""What rounding colours costs, the steps in which it pays, and how good a picture has to be before that."""

from __future__ import annotations

import math

from gcvec.error_scale import PEAK_SQUARE
from gcvec.quantization import Quantization

LOSS = 1.15
"""Rounding colours as a file does costs about this much more than rounding to nearest, see its dead zone: the
first guess, until a file has been made."""

LEAST_LESSON = 0.1
"""What rounding is taken to cost falls no further than to this share when a file is looked at."""

CAREFUL = 0.98
MORE_CAREFUL = 0.995
"""The first aim is lower than it need be by this factor, since missing the target costs another round; and
after each miss by another one."""

LEAST_AIM = 0.5
"""The aim is at least this share of the target."""

SHARE = 0.2
"""c / (2 b) in `Rounding.weigh`, as measured on photos."""

COARSEST = 1.25
"""Steps are made larger by this factor at most: beyond, points get so many that refinement takes longer for
next to no bytes."""


class Rounding:
    """What is known of it: more with every file. Errors are mean squared ones on the 0-255 scale.

    `energy_a_pixel` is what all colours give to a pixel, in squares, of the picture in question.
    """

    def __init__(self, target_mse: float, steps: Quantization, axes: int = 3) -> None:
        """Files that come to `target_mse` in about these steps, the planned ones, of colours that vary along
        so many axes."""
        self._target_mse = target_mse
        self.steps = steps
        self._loss = LOSS * axes / 3
        self._margin = CAREFUL

    def cost(self, steps: Quantization, energy_a_pixel: float) -> float:
        """The error that rounding is expected to add, to these steps and then to 8 bits.

        Rounding to steps of s spreads over s**2 / 12 for every colour, and as much of that reaches the
        picture as the colour has energy there.
        """
        return (1 + self._loss * PEAK_SQUARE * steps.point**2 * energy_a_pixel) / 12

    def aim(self, energy_a_pixel: float) -> float:
        """The error before rounding that leaves the target after it."""
        left = self._target_mse - self.cost(self.steps, energy_a_pixel)
        return self._margin * max(left, LEAST_AIM * self._target_mse)

    def weigh(self, rise: float, energy_a_pixel: float) -> None:
        """Plan larger steps where points are cheap, as in textures.

        `rise` is by what share the error before rounding, M, rises for each share of the points that is taken
        out. N points take N b bytes, of which steps larger by a factor e save N c, and add R to M, which goes
        with their square. So for one M + R they take the fewest bytes where R = M rise c / (2 b). Steps stay
        as planned where that asks for smaller ones, which save points but hardly a byte.
        """
        ratio = SHARE * max(rise, 0.0)
        best_cost = self._target_mse * ratio / (1 + ratio)
        factor = math.sqrt(best_cost / self.cost(self.steps, energy_a_pixel))
        self.steps = self.steps.scaled(min(max(factor, 1.0), COARSEST))

    def learn(
        self, steps: Quantization, energy_a_pixel: float, before: float, after: float, lack: float
    ) -> None:
        """See what rounding has cost: the error was `before`, and is `after` in a file with these steps.

        `lack` is what no point can save of either.
        """
        missed_by = (after - lack) / self._target_mse * self.aim(energy_a_pixel) / max(before - lack, 1e-9)
        self._loss *= max((after - before) / self.cost(steps, energy_a_pixel), LEAST_LESSON)
        if after - lack > self._target_mse:
            self._margin *= MORE_CAREFUL / max(missed_by, 1.0)
