"""`gcvec edit`: move control points and recolour patches of a .gcv file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from typer import Argument, BadParameter, Option

from gcvec.cli._files import about, load_vector_image, require_folder, warn, write

if TYPE_CHECKING:
    from gcvec.edit import Move, Recolor

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
MOVE = re.compile(rf"(\d+):(\d+):({NUMBER}),({NUMBER})")
RECOLOR = re.compile(r"(\d+):#([0-9a-fA-F]{6})")


def edit(
    vector_image: Annotated[
        Path, Argument(metavar="IN.gcv", exists=True, dir_okay=False, readable=True, help="A vector image.")
    ],
    output: Annotated[Path, Option("-o", "--output", metavar="OUT.gcv", help="Where the result goes.")],
    move: Annotated[
        list[str] | None,
        Option(
            metavar="CURVE:INDEX:DX,DY",
            help="Shift a control point of a curve by pixels; neighbours follow. Can be given repeatedly.",
        ),
    ] = None,
    recolor: Annotated[
        list[str] | None,
        Option(
            metavar="PATCH:#rrggbb",
            help="Give a patch this mean colour; its shading stays. Can be given repeatedly.",
        ),
    ] = None,
) -> None:
    """Move control points of boundary curves and recolour patches. Nothing is fitted again."""
    require_folder(output)
    moves = [_move(text) for text in move or ()]
    recolors = [_recolor(text) for text in recolor or ()]
    if not moves and not recolors:
        raise BadParameter("nothing to do: give --move or --recolor")
    image = load_vector_image(vector_image)

    from gcvec.edit import edit

    with about(vector_image):
        edited = edit(image, moves, recolors)
    if edited.foldovers:
        warn(output, [f"triangles that fold over after these moves: {edited.foldovers}"])
    write(output, edited.to_bytes())


def _move(text: str) -> Move:
    from gcvec.edit import Move

    found = MOVE.fullmatch(text)
    if not found:
        raise BadParameter(f"{text!r} is not CURVE:INDEX:DX,DY, such as 3:2:1.5,-4", param_hint="'--move'")
    curve, index, dx, dy = found.groups()
    return Move(int(curve), int(index), float(dx), float(dy))


def _recolor(text: str) -> Recolor:
    from gcvec.edit import Recolor, hex_color

    found = RECOLOR.fullmatch(text)
    if not found:
        raise BadParameter(f"{text!r} is not PATCH:#rrggbb, such as 2:#f08020", param_hint="'--recolor'")
    return Recolor(int(found[1]), hex_color(found[2]))
