"""What several commands take, declared once: kinds of files, the picture, options."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from gcvec.errors import InputError
from gcvec.hex_color import rgb_from_hex
from gcvec.options import MOST_EFFORT, Options, without_effect

Function = Callable[..., Any]

INPUT_FILE = click.Path(exists=True, dir_okay=False, readable=True, allow_dash=True, path_type=Path)
"""An existing file, or - for stdin."""


class _OutputFile(click.Path):
    """A path that does not end as those of folders do, which `pathlib` would take for one of a file."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        if str(value).endswith(os.sep):
            self.fail(f"{value}: names a folder, not the file to be written", param, ctx)
        return super().convert(value, param, ctx)


OUTPUT_FILE = _OutputFile(allow_dash=True, path_type=Path)
"""A file to be written, or - for stdout."""

OTHER_FORMATS = (".png", ".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".svg", ".pdf", ".glb", ".json")
"""Endings that promise a picture or a document, which a vector image is not."""


def _named_as_vector_image(_context: click.Context, _parameter: click.Parameter, output: str) -> str:
    ending = Path(output).suffix
    if ending.lower() in OTHER_FORMATS and not output.endswith(os.sep):
        raise click.BadParameter(
            f"{output}: a vector image is written, which ends in .gcv (gcvec render makes a {ending})"
        )
    return output


picture_argument = click.argument(
    "image", type=INPUT_FILE, help="A PNG, JPEG, WebP or TIFF picture; - for stdin."
)
annotations_option = click.option(
    "-a",
    "--annotations",
    type=INPUT_FILE,
    help="Regions: CVAT for images 1.1 or COCO 1.0; - for stdin. "
    "Without it the regions are found automatically.",
)
vector_image_output_option = click.option(
    "-o",
    "--output",
    required=True,
    type=click.Path(allow_dash=True),
    callback=_named_as_vector_image,
    metavar="OUT.gcv",
    help="Where the vector image goes; FOLDER/: into this folder, named like the input; - for stdout.",
)
image_name_option = click.option(
    "--image-name",
    metavar="NAME",
    help="The picture's name in the annotations; default: the file's own name, "
    "beside folders where several have it, else the only one.",
)


def checked_matte(_context: click.Context, _parameter: click.Parameter, matte: str | None) -> str | None:
    """A colour, wherever it comes from: click names the option and the variable. None stays none."""
    try:
        if matte is not None:
            rgb_from_hex(matte, "matte")
    except InputError as error:
        raise click.BadParameter(str(error)) from None
    return matte


matte_option = click.option(
    "--matte",
    default="#ffffff",
    callback=checked_matte,
    metavar="#RRGGBB",
    envvar="GCVEC_MATTE",
    show_envvar=True,
    help="What transparent pixels are laid over.",
)

_VECTORIZATION = (
    click.option(
        "--regions",
        type=int,
        default=Options.regions,
        metavar="N",
        help="How many automatic regions; 0: as many as pay for themselves.",
    ),
    click.option(
        "--snap",
        type=float,
        default=Options.snap,
        metavar="PX",
        help="How far annotated borders may move onto edges; 0: only made smooth.",
    ),
    click.option(
        "--effort",
        type=int,
        default=Options.effort,
        metavar=f"1..{MOST_EFFORT}",
        help="Time to spend on a smaller file; batch strategy only.",
    ),
    click.option(
        "--target-bytes",
        type=int,
        default=Options.target_bytes,
        metavar="N",
        help="Largest file; the error is as small as it allows. 0: --target-mse decides.",
    ),
    click.option(
        "--strategy",
        type=click.Choice(("batch", "paper")),
        default=Options.strategy,
        help="How interior control points are placed.",
    ),
    click.option(
        "--target-mse",
        type=float,
        default=Options.target_mse,
        help="Mean squared error of the picture (0-255 scale) at which refinement stops.",
    ),
    click.option(
        "--max-points",
        type=int,
        default=Options.max_points,
        help="Most interior control points of one region; 0: no limit.",
    ),
)


def vectorization_options(command: Function) -> Function:
    """The command with the options added that have a picture vectorized, here or by a service.

    It gets each under the name that it has in `Options`, which also checks their ranges.
    """
    for option in reversed(_VECTORIZATION):
        command = option(command)
    return command


def ignored_options(options: Mapping[str, Any], annotations: Path | None) -> list[str]:
    """The vectorization options that were asked for and have no effect beside the rest, one line each."""
    source_of = click.get_current_context().get_parameter_source
    ignored = without_effect(options, annotations is not None, lambda name: f"--{name.replace('_', '-')}")
    return [line for name, line in ignored.items() if source_of(name) is ParameterSource.COMMANDLINE]
