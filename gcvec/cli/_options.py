"""Options that every command takes which has a picture vectorized, here or by a service."""

from __future__ import annotations

from typing import Annotated, Literal

from typer import Option

WHITE = "#ffffff"

Regions = Annotated[
    int, Option(metavar="N", help="How many automatic regions; 0: as many as pay for themselves.")
]
Snap = Annotated[
    float, Option(metavar="PX", help="How far annotated borders may move onto edges; 0: kept as drawn.")
]
Strategy = Annotated[Literal["batch", "paper"], Option(help="How interior control points are placed.")]
TargetMse = Annotated[
    float, Option(help="Mean squared error of the picture (0-255 scale) at which refinement stops.")
]
Matte = Annotated[
    str, Option(metavar="#RRGGBB", envvar="GCVEC_MATTE", help="What transparent pixels are laid over.")
]
MaxPoints = Annotated[int, Option(help="Most interior control points of one region; 0: no limit.")]
Effort = Annotated[
    int, Option(metavar="1..9", help="Time to spend on fewer control points; batch strategy only.")
]
TargetBytes = Annotated[
    int,
    Option(metavar="N", help="Largest file; the error is as small as it allows. 0: --target-mse decides."),
]
