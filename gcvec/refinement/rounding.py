"""What rounding colours costs, the steps in which it pays, and how good a picture has to be before that."""

from __future__ import annotations

import math

from gcvec.error_scale import PEAK_SQUARE
from gcvec.quantization import Quantization

ENERGY = 8.8
"""What rounding a colour adds goes with its energy in the picture and the square of its step, and so is the
same for all of them (`gcvec.codec.strides`): this is the energy of those that are stored in whole steps."""

LOSS = 0.92
"""Rounding colours as a file does costs about this many times what each for itself rounded to nearest would:
they make up for each other, but there is a dead zone. The first guess, until a file has been made."""

LEAST_LESSON = 0.1
"""What rounding is taken to cost falls no further than to this share when a file is looked at."""

CAREFUL = 0.98
MORE_CAREFUL = 0.995
"""The first aim is lower than it need be by this factor, since missing the target costs another round; and
after each miss by another one."""

PLANNED = 0.15
"""The share of the target that rounding colours takes, unless it pays to let it take more."""

TO_8_BIT = 1 / 12
"""What rounding to whole levels adds."""

LEAST_AIM = 0.5
"""The aim is at least this share of the target."""

SHARE = 0.2
"""c / (2 b) in `Rounding.weigh`, as measured on photos."""

MOST = 1.56
"""Rounding takes up to this many times what it is planned to: beyond, points get so many that refinement
takes longer for next to no bytes."""

LITTLE = 0.3
"""A share of the aim: where regions lack no more than that, larger steps of colours can be made up for."""

LEAST_STEP, LARGEST_STEP = 1 / 8, 1.6
"""The usual step is no smaller than the first, levels of 255, and no larger than the second for each unit of
the root of the target: where few colours make up a picture, errors of theirs would be seen."""


def lacks_little(lack: float, aim: float) -> bool:
    """Whether a picture that aims at so much, of which regions lack so much, may have larger steps."""
    return lack <= LITTLE * aim


class Rounding:
    """What is known of it: more with every file. Errors are mean squared ones on the 0-255 scale.

    `density` is how many colours there are for each pixel of the picture in question.
    """

    def __init__(self, target_mse: float, axes: int = 3) -> None:
        """Files that come to `target_mse`, of colours that vary along so many axes."""
        self._target_mse = target_mse
        self._planned = TO_8_BIT + PLANNED * target_mse
        self._most = MOST * self._planned
        self._loss = LOSS * axes / 3
        self._margin = CAREFUL

    def cost(self, steps: Quantization, density: float) -> float:
        """The error that rounding is expected to add, to these steps and then to 8 bits.

        Rounding to steps of s spreads over s**2 / 12 for every colour.
        """
        return TO_8_BIT + self._loss * ENERGY * PEAK_SQUARE * steps.point**2 * density / 12

    def steps(self, density: float) -> Quantization:
        """Steps that add as much as is planned."""
        spread = 12 * (self._planned - TO_8_BIT) / (self._loss * ENERGY * max(density, 1e-9))
        levels = max(min(math.sqrt(spread), LARGEST_STEP * math.sqrt(self._target_mse)), LEAST_STEP)
        return Quantization.of_colors(levels / math.sqrt(PEAK_SQUARE))

    def aim(self, density: float) -> float:
        """The error before rounding that leaves the target after it."""
        left = self._target_mse - self.cost(self.steps(density), density)
        return self._margin * max(left, LEAST_AIM * self._target_mse)

    def weigh(self, rise: float) -> None:
        """Plan larger steps where points are cheap, as in textures.

        `rise` is by what share the error before rounding, M, rises for each share of the points that is taken
        out. N points take N b bytes, of which steps larger by a factor e save N c, and add R to M, which goes
        with their square. So for one M + R they take the fewest bytes where R = M rise c / (2 b). Steps stay
        as planned where that asks for smaller ones, which save points but hardly a byte.
        """
        ratio = SHARE * max(rise, 0.0)
        self._planned = min(max(self._target_mse * ratio / (1 + ratio), self._planned), self._most)

    def learn(self, steps: Quantization, density: float, before: float, after: float, lack: float) -> None:
        """See what rounding has cost: the error was `before`, and is `after` in a file with these steps.

        `lack` is what no point can save of either.
        """
        missed_by = (after - lack) / self._target_mse * self.aim(density) / max(before - lack, 1e-9)
        self._loss *= max((after - before) / self.cost(steps, density), LEAST_LESSON)
        if after - lack > self._target_mse:
            self._margin *= MORE_CAREFUL / max(missed_by, 1.0)
