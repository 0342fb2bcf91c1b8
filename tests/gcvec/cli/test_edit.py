"""`gcvec edit`: moves and colours as they are typed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gcvec import VectorImage
from gcvec.edit import mean_color
from tests.command import gcvec, refused


@pytest.mark.usefixtures("vectorized")
def test_edit(folder: Path, tmp_path: Path) -> None:
    output = tmp_path / "edited.gcv"
    image = VectorImage.load(folder / "photo.gcv")
    curve = next(k for k, c in enumerate(image.curves) if not c.on_frame)
    run = gcvec(
        "edit", folder / "photo.gcv", "-o", output, "--move", f"{curve}:1:-0.5,.25", "--recolor", "1:#204060"
    )
    assert run.returncode == 0, run.stderr
    edited = VectorImage.load(output)
    assert edited.control_points is not None
    shift = edited.control_points - image.foundation.control_points
    assert np.unique(shift[shift.any(axis=1)], axis=0).tolist() == [[-0.5, 0.25]]
    assert np.abs(mean_color(edited, 1) * 255 - [0x20, 0x40, 0x60]).max() < 3


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--move", "1:2:3"),
        ("--move", "1:2:nan,1"),
        ("--move", "999:0:1,1"),
        ("--move", "\u0660:0:1,1"),
        ("--recolor", "0:red"),
        ("--recolor", "\u0660:#ffffff"),
        ("--recolor", "99:#ffffff"),
        ("--recolor", f"{10**20}:#ffffff"),
    ],
)
@pytest.mark.usefixtures("vectorized")
def test_edit_refuses(folder: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    output = tmp_path / "edited.gcv"
    refused(
        gcvec("edit", folder / "photo.gcv", "-o", output, *options), *(o.split(":")[0] for o in options[1:])
    )
    assert not output.exists()
