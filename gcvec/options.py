"""The settings of one vectorization, the same on the command line and over HTTP."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Literal, NamedTuple

from gcvec.error_scale import PEAK_SQUARE
from gcvec.errors import InputError

MOST_SNAP = 20
"""Borders that move further, in pixels, are no longer those that were drawn."""

MOST_EFFORT = 9

LARGEST_COUNT = 2**31 - 1
"""Of what is counted: compiled kernels take no larger numbers."""


class Range(NamedTuple):
    """The numbers that an option may be: from `least` to `most`, or only between them, without `ends`."""

    least: int
    most: int
    ends: bool = True

    def holds(self, number: float) -> bool:
        within = self.least <= number <= self.most
        return within and (self.ends or number not in (self.least, self.most))

    def __str__(self) -> str:
        if self.ends:
            return f"lie between {self.least} and {self.most}"
        return f"be above {self.least} and below {self.most}"


RANGES: Mapping[str, Range] = {
    "target_mse": Range(0, PEAK_SQUARE, ends=False),
    "snap": Range(0, MOST_SNAP),
    "effort": Range(1, MOST_EFFORT),
    **dict.fromkeys(("max_points", "workers", "regions", "target_bytes"), Range(0, LARGEST_COUNT)),
}
"""Of all options that are numbers."""


@dataclass(frozen=True)
class Options:
    """How a picture is vectorized.

    `strategy` is how interior control points are placed: in batches, or one at a time exactly as in the
    paper. `target_mse` is the mean squared error on the 0-255 scale at which refinement stops: that of the
    whole anti-aliased picture, or, with "paper", of each region by itself, at pixel centres; `max_points`
    bounds the interior control points of one region, 0 lifts the bound; `workers` is the number of threads, 0
    for one a core; `regions` is the number of automatic regions wanted when there are no annotations, 0 lets
    the picture decide; `snap` is how many pixels the borders of annotated regions may move onto the picture's
    edges, with 0 they are only made smooth; `effort`, 1 to 9, trades time for a smaller file with the
    strategy "batch"; `target_bytes`, if not 0, is the size that the file must not exceed: the error is then
    as small as that allows, whatever `target_mse` says.
    """

    strategy: Literal["batch", "paper"] = "batch"
    target_mse: float = 5.0
    max_points: int = 2000
    workers: int = 0
    regions: int = 0
    snap: float = 2.5
    effort: int = 5
    target_bytes: int = 0

    def __post_init__(self) -> None:
        if self.strategy not in ("batch", "paper"):
            raise self._refused("strategy", "be 'batch' or 'paper'")
        for name in ("max_points", "workers", "regions", "effort", "target_bytes"):
            if not isinstance(getattr(self, name), Integral):
                raise self._refused(name, "be a whole number")
        for name in ("target_mse", "snap"):
            if not isinstance(getattr(self, name), Real):
                raise self._refused(name, "be a number")
        for name, numbers in RANGES.items():
            if not numbers.holds(getattr(self, name)):
                raise self._refused(name, str(numbers))

    def _refused(self, name: str, wanted: str) -> InputError:
        value = getattr(self, name)
        return InputError(f"{name} must {wanted}, not {value!r}", code="bad-option", pointer=name)


def without_effect(
    options: Mapping[str, Any], annotated: bool, spelled: Callable[[str], str] = str
) -> dict[str, str]:
    """The options that have no effect beside the rest, each with a line that says so and why.

    `annotated` tells whether annotations come with the picture, `spelled` how a line writes an option's name.
    """
    reasons = (
        ("regions", annotated, "the annotations say what the regions are"),
        ("snap", not annotated, "there are no annotations"),
        ("target_mse", options["target_bytes"] > 0, f"{spelled('target_bytes')} decides"),
        ("effort", options["strategy"] == "paper", "it is for the strategy batch"),
    )
    return {name: f"{spelled(name)} has no effect: {why}" for name, is_ignored, why in reasons if is_ignored}
