"""The command line in a pipe: - for stdin and stdout, and streams that the caller has closed."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage

GCVEC = f"{sys.executable} -m gcvec.cli"
REGIONS = """<annotations><image id="0" name="photo.png" width="40" height="30">
<polygon label="left" points="0,0;20,0;20,30;0,30"/></image></annotations>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo with a transparent corner, which makes a warning; its regions; its vector image."""
    folder = tmp_path_factory.mktemp("streams")
    y, x = np.mgrid[:30, :40]
    pixels = np.stack([80 + x, 90 + y, np.where(x < 20, 30, 220), np.full_like(x, 255)], axis=-1)
    pixels[:4, :4, 3] = 0
    Image.fromarray(pixels.astype(np.uint8)).save(folder / "photo.png")
    (folder / "regions.xml").write_text(REGIONS)
    assert shell("gcvec vectorize photo.png -a regions.xml -o photo.gcv", folder).returncode == 0
    return folder


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[bytes]:
    """Run a line of shell in which `gcvec` is the command."""
    return subprocess.run(
        ["sh", "-c", line.replace("gcvec ", f"{GCVEC} ")], capture_output=True, cwd=folder, timeout=120
    )


@pytest.mark.parametrize(
    "line",
    [
        "cat photo.png | gcvec vectorize - -a regions.xml -o -",
        "cat regions.xml | gcvec vectorize photo.png -a - -o -",
        "gcvec vectorize photo.png -a regions.xml -o - | cat",
    ],
)
def test_a_vector_image_through_pipes(folder: Path, line: str) -> None:
    run = shell(line, folder)
    assert run.returncode == 0
    assert run.stdout == (folder / "photo.gcv").read_bytes()
    assert b"transparent pixels" in run.stderr


def test_every_command_reads_a_vector_image_from_stdin(folder: Path) -> None:
    assert shell("gcvec render - -o drawn.png < photo.gcv", folder).returncode == 0
    assert (folder / "drawn.png").read_bytes().startswith(b"\x89PNG")
    compared = shell("gcvec compare photo.png - --json < photo.gcv", folder)
    assert json.loads(compared.stdout)["bytes"] == (folder / "photo.gcv").stat().st_size
    edited = shell("gcvec edit - --recolor 0:#204060 -o - < photo.gcv", folder)
    assert VectorImage.from_bytes(edited.stdout).labels == ("left", "background")


def test_report_or_preview_to_stdout(folder: Path) -> None:
    report = shell("gcvec vectorize photo.png -o a.gcv --report -", folder)
    assert json.loads(report.stdout)["image"] == {"width": 40, "height": 30}
    preview = shell("gcvec vectorize photo.png -o a.gcv --preview -", folder)
    with Image.open(io.BytesIO(preview.stdout)) as picture:
        assert (picture.format, picture.size) == ("PNG", (40, 30))


def test_bad_input_on_stdin_is_refused(folder: Path) -> None:
    run = shell("echo no picture | gcvec vectorize - -o -", folder)
    assert (run.returncode, run.stdout) == (2, b"")
    assert run.stderr.startswith(b"gcvec: -: unsupported picture")


def test_a_closed_stderr_is_no_failure_and_stays_out_of_stdout(folder: Path) -> None:
    run = shell("gcvec vectorize photo.png -a regions.xml -o - 2>&-", folder)
    assert (run.returncode, run.stderr) == (0, b"")
    assert run.stdout == (folder / "photo.gcv").read_bytes()
    refused = shell("gcvec vectorize missing.png -o - 2>&-", folder)
    assert (refused.returncode, refused.stdout, refused.stderr) == (2, b"", b"")


@pytest.mark.skipif(sys.platform != "linux", reason="names of files are text elsewhere")
@pytest.mark.parametrize("stderr", ["", "2>&-"])
def test_names_that_are_no_text_are_named_all_the_same(folder: Path, stderr: str) -> None:
    odd = os.fsdecode(b"odd\xff")
    (folder / odd).write_text("no picture")
    run = shell(f"gcvec vectorize '{odd}' -o a.gcv {stderr}", folder)
    assert (run.returncode, run.stdout) == (2, b"")
    assert run.stderr.startswith(b"" if stderr else b"gcvec: odd\\udcff: unsupported picture: ")
    photo = f"{odd}.png"
    (folder / photo).write_bytes((folder / "photo.png").read_bytes())
    for regions in ("odd.xml", "odd.json"):
        assert shell(f"gcvec regions '{photo}' -o {regions} {stderr}", folder).returncode == 0
        text = (folder / regions).read_text(encoding="utf-8")
        assert '"odd\\ufffd.png"' in text or '"odd\ufffd.png"' in text
        again = shell(f"gcvec vectorize '{photo}' -a {regions} -o - {stderr}", folder)
        assert again.returncode == 0
        assert again.stdout.startswith(b"GCV")


@pytest.mark.parametrize(
    ("line", "cause"),
    [
        ("gcvec vectorize photo.png -o - >&-", b"stdout is closed"),
        ("gcvec compare photo.png photo.gcv >&-", b"stdout is closed"),
        ("gcvec vectorize - -o a.gcv <&-", b"stdin is closed"),
    ],
)
def test_closed_streams_that_are_needed_are_named(folder: Path, line: str, cause: bytes) -> None:
    run = shell(line, folder)
    assert run.returncode == 1
    assert run.stderr.splitlines()[-1] == b"gcvec: -: " + cause


def test_closed_streams_that_are_not_needed_do_not_matter(folder: Path) -> None:
    assert shell("gcvec vectorize photo.png -o b.gcv >&- <&-", folder).returncode == 0
    assert VectorImage.load(folder / "b.gcv").width == 40


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("line", ["gcvec ", "gcvec --help", "gcvec vectorize --help"])
def test_a_stdout_that_takes_nothing_is_one_line(folder: Path, line: str) -> None:
    run = shell(f"{line} > /dev/full", folder)
    assert run.returncode == 1
    assert run.stderr.startswith(b"gcvec: ")
    assert run.stderr.endswith(b"No space left on device\n")
    assert run.stderr.count(b"\n") == 1


def test_a_reader_that_has_left_ends_the_command_quietly(folder: Path) -> None:
    run = shell("{ gcvec vectorize photo.png -a regions.xml -o -; echo $? >&2; } | true", folder)
    *warnings, code = run.stderr.splitlines()
    assert code == b"1"
    assert all(line.startswith(b"gcvec: warning: ") for line in warnings)
