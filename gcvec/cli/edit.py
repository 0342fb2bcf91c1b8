"""`gcvec edit`: move control points and recolour patches of a .gcv file."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import click

from gcvec.cli._files import about, check_files, load_vector_image, read, vector_image_file, warn, write
from gcvec.cli._options import INPUT_FILE, vector_image_output_option
from gcvec.hex_color import HEX_COLOR

if TYPE_CHECKING:
    from gcvec.edit import Move, Recolor

NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)"
MOVE = re.compile(rf"(\d+):(\d+):({NUMBER}),({NUMBER})", re.ASCII)
RECOLOR = re.compile(rf"(\d+):({HEX_COLOR})", re.ASCII)


@click.command()
@click.argument("vector_image", type=INPUT_FILE, metavar="IN.gcv", help="A vector image; - for stdin.")
@vector_image_output_option
@click.option(
    "--move",
    multiple=True,
    metavar="CURVE:INDEX:DX,DY",
    help="Shift a control point of a curve by pixels; neighbours follow. Can be given repeatedly.",
)
@click.option(
    "--recolor",
    multiple=True,
    metavar="PATCH:#rrggbb",
    help="Give a patch this mean colour; its shading stays. Can be given repeatedly.",
)
def edit(vector_image: Path, output: str, move: tuple[str, ...], recolor: tuple[str, ...]) -> None:
    """Move control points of boundary curves and recolour patches. Nothing is fitted again."""
    target = vector_image_file(output, vector_image)
    check_files(outputs=(target,))  # which may be the input too
    moves = [_move(text) for text in move]
    recolors = [_recolor(text) for text in recolor]
    if not moves and not recolors:
        raise click.BadParameter("nothing to do: give --move or --recolor")
    image = load_vector_image(read(vector_image), vector_image)

    from gcvec.edit import edit

    with about(vector_image):
        edited = edit(image, moves, recolors)
    if edited.foldovers:
        warn(target, [f"triangles that fold over after these moves: {edited.foldovers}"])
    write(target, edited.to_bytes())


def _move(text: str) -> Move:
    from gcvec.edit import Move

    found = MOVE.fullmatch(text)
    if not found:
        raise click.BadParameter(
            f"{text!r} is not CURVE:INDEX:DX,DY, such as 3:2:1.5,-4", param_hint="'--move'"
        )
    curve, index, dx, dy = found.groups()
    return Move(int(curve), int(index), float(dx), float(dy))


def _recolor(text: str) -> Recolor:
    from gcvec.edit import Recolor, hex_color

    found = RECOLOR.fullmatch(text)
    if not found:
        raise click.BadParameter(
            f"{text!r} is not PATCH:#rrggbb, such as 2:#f08020", param_hint="'--recolor'"
        )
    return Recolor(int(found[1]), hex_color(found[2]))
