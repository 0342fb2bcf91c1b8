"""What is measured, in full and in short."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Plan:
    """Sizes are megapixels, targets mean squared errors on the 0-255 scale.

    Every picture of `pictures` is vectorized at `size` to every one of `targets`; times are shown of the one
    to `timed_target`, and again with all `efforts`, and of the whole command, also on a picture of
    `tiny_size`. The first is also vectorized at all `growth_sizes`, to `growth_target`. Every one is
    vectorized by the paper's strategy at `paper_size`, in `paper_regions` regions, to `paper_target`, and by
    the default one to the error that comes of it.
    """

    pictures: tuple[str, ...]
    size: float
    tiny_size: float
    targets: tuple[float, ...]
    timed_target: float
    efforts: tuple[int, ...]
    growth_sizes: tuple[float, ...]
    growth_target: float
    paper_size: float
    paper_regions: int
    paper_target: float


FULL = Plan(
    pictures=("astronaut", "chelsea", "coffee", "rocket"),
    size=0.07,
    tiny_size=0.004,
    targets=(20, 10, 5, 3),
    timed_target=5,
    efforts=(1, 3, 5, 7, 9),
    growth_sizes=(0.1, 0.3, 1, 3, 12),
    growth_target=20,
    paper_size=0.004,
    paper_regions=3,
    paper_target=40,
)

QUICK = Plan(
    pictures=("coffee",),
    size=0.006,
    tiny_size=0.001,
    targets=(60,),
    timed_target=60,
    efforts=(1, 5),
    growth_sizes=(0.003, 0.006),
    growth_target=100,
    paper_size=0.001,
    paper_regions=2,
    paper_target=120,
)


def up_to(megapixels: float, plan: Plan) -> Plan:
    """The plan without larger pictures."""
    return replace(plan, growth_sizes=tuple(size for size in plan.growth_sizes if size <= megapixels))
