"""The command as users and scripts run it: exit codes, one line of error, files written."""

import json
import os
import pty
import resource
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import click
import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage
from gcvec.cli._app import root, run
from gcvec.cli._postponed import POSTPONED
from gcvec.edit import mean_color

WIDTH, HEIGHT = 64, 48


def gcvec(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "gcvec.cli", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, cwd=cwd, timeout=120)


def refused(run: subprocess.CompletedProcess[str], *named: object) -> None:
    """Bad input: exit 2, and one line on stderr that holds all of `named`."""
    assert run.returncode == 2, run.stderr
    assert run.stdout == ""
    assert run.stderr.startswith("gcvec: ")
    assert run.stderr.count("\n") == 1
    for part in named:
        assert str(part) in run.stderr


def loaded_by(*arguments: object) -> set[str]:
    """The modules that are there at the end of a command, those still to be loaded not among them."""
    script = f"""
import sys
from importlib.util import _LazyModule

from gcvec.cli import main

sys.argv = ["gcvec", *{list(map(str, arguments))}]
try:
    main()
finally:
    print(*(name for name, module in sys.modules.items() if type(module) is not _LazyModule))
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.split())


def annotations(*, width: int = WIDTH, height: int = HEIGHT, name: str = "photo.png") -> str:
    return f"""<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version><image id="0" name="{name}" width="{width}" height="{height}">
<polygon label="ground" points="0,0;{WIDTH},0;{WIDTH},{HEIGHT};0,{HEIGHT}" z_order="0"></polygon>
<polygon label="box" points="16,12;45,15;41,36;18,33" z_order="1"></polygon>
</image></annotations>"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo with its regions, and all that `gcvec vectorize` writes for it."""
    folder = tmp_path_factory.mktemp("cli")
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    ground = np.stack([60 + x, 90 + y, 200 - x - y], axis=-1)
    box = np.stack([250 - x, 120 + x, 40 + 2 * y], axis=-1)
    inside = (x >= 17) & (x < 43) & (y >= 14) & (y < 34)
    Image.fromarray(np.where(inside[..., None], box, ground).astype(np.uint8)).save(folder / "photo.png")
    (folder / "photo.xml").write_text(annotations())
    return folder


@pytest.fixture(scope="module")
def vectorized(folder: Path) -> subprocess.CompletedProcess[str]:
    files = ("photo.png", "-a", "photo.xml", "-o", "photo.gcv", "--report", "r.json", "--preview", "p.png")
    return gcvec("vectorize", *files, cwd=folder)


def test_vectorize_writes_what_it_is_asked_for(
    folder: Path, vectorized: subprocess.CompletedProcess[str]
) -> None:
    assert (vectorized.returncode, vectorized.stdout) == (0, ""), vectorized.stderr
    assert "%" not in vectorized.stderr
    report = json.loads((folder / "r.json").read_text())
    assert report["image"] == {"width": WIDTH, "height": HEIGHT}
    assert report["bytes"] == (folder / "photo.gcv").stat().st_size
    assert report["patches"] == len(report["regions"]) == 2
    assert {region["label"] for region in report["regions"]} == {"ground", "box"}
    assert report["foldovers"] == 0
    error = _pixels(folder / "p.png") - _pixels(folder / "photo.png")
    assert np.mean(error**2) == pytest.approx(report["mse"], abs=0.05)
    assert sorted(p.name for p in folder.iterdir() if p.name.startswith(".")) == []


@pytest.mark.usefixtures("vectorized")
@pytest.mark.parametrize(("scale", "size"), [("1", (64, 48)), ("2.5", (160, 120))])
def test_render_png(folder: Path, tmp_path: Path, scale: str, size: tuple[int, int]) -> None:
    run = gcvec("render", folder / "photo.gcv", "-o", tmp_path / "a.PNG", "--scale", scale)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    with Image.open(tmp_path / "a.PNG") as picture:
        assert (picture.format, picture.size) == ("PNG", size)


@pytest.mark.usefixtures("vectorized")
def test_a_small_picture_does_not_wait_for_what_it_does_not_need(folder: Path, tmp_path: Path) -> None:
    slow = {"scipy.linalg", "scipy.ndimage", "scipy.special", *POSTPONED}
    slow |= {"pydantic", "skimage"}
    for regions in ((), ("-a", folder / "photo.xml")):
        loaded = loaded_by("vectorize", folder / "photo.png", *regions, "-o", tmp_path / "a.gcv")
        assert {"numpy", "scipy.sparse", "gcvec.refinement.batch"} <= loaded
        assert not loaded & slow
    assert not loaded_by("regions", folder / "photo.png", "-o", tmp_path / "a.xml") & slow


def test_raw_samples_pixel_centres(folder: Path, tmp_path: Path) -> None:
    for name, option in (("raw.png", ["--raw"]), ("box.png", [])):
        assert gcvec("render", folder / "photo.gcv", "-o", tmp_path / name, *option).returncode == 0
    assert not np.array_equal(_pixels(tmp_path / "raw.png"), _pixels(tmp_path / "box.png"))


@pytest.mark.usefixtures("vectorized")
def test_render_json(folder: Path, tmp_path: Path) -> None:
    assert gcvec("render", folder / "photo.gcv", "-o", tmp_path / "a.json").returncode == 0
    description = json.loads((tmp_path / "a.json").read_text())
    assert description["format"] == "gcvec/1"
    assert {patch["label"] for patch in description["patches"]} == {"ground", "box"}


@pytest.mark.usefixtures("vectorized")
@pytest.mark.parametrize(("ending", "magic"), [("svg", b"<?xml"), ("pdf", b"%PDF-1.4"), ("glb", b"glTF")])
def test_render_documents(folder: Path, tmp_path: Path, ending: str, magic: bytes) -> None:
    file = tmp_path / f"a.{ending}"
    run = gcvec("render", folder / "photo.gcv", "-o", file)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")
    assert file.read_bytes().startswith(magic)


@pytest.mark.usefixtures("vectorized")
def test_compare(folder: Path) -> None:
    run = gcvec("compare", folder / "photo.png", folder / "photo.gcv", "--json")
    assert (run.returncode, run.stderr) == (0, "")
    measured, report = json.loads(run.stdout), json.loads((folder / "r.json").read_text())
    names = ("mse", "mse_raw", "mae", "psnr", "ssim", "patches", "points", "bytes", "foldovers")
    assert tuple(measured) == names
    assert measured == pytest.approx({name: report[name] for name in names}, abs=1e-6)
    lines = gcvec("compare", folder / "photo.png", folder / "photo.gcv").stdout.splitlines()
    assert [line.split()[0] for line in lines] == list(names)


@pytest.mark.usefixtures("vectorized")
def test_compare_refuses_another_size(folder: Path, tmp_path: Path) -> None:
    Image.new("RGB", (10, 10)).save(tmp_path / "small.png")
    refused(gcvec("compare", tmp_path / "small.png", folder / "photo.gcv"), "photo.gcv", "10 x 10", "64 x 48")


@pytest.mark.usefixtures("vectorized")
@pytest.mark.parametrize(
    "options",
    [
        ("-o", "a.bmp"),
        ("-o", "a"),
        ("-o", "a.png", "--scale", "0"),
        ("-o", "a.png", "--scale", "nan"),
        ("-o", "a.png", "--scale", "1e6"),
        ("-o", "a.json", "--raw"),
        ("-o", "nowhere/a.png"),
    ],
)
def test_render_refuses(folder: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    refused(gcvec("render", folder / "photo.gcv", *options, cwd=tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_bad_pictures(folder: Path, tmp_path: Path) -> None:
    text = tmp_path / "notes.png"
    text.write_text("not a picture")
    truncated = tmp_path / "truncated.png"
    truncated.write_bytes((folder / "photo.png").read_bytes()[:-100])
    for image in (tmp_path / "missing.png", tmp_path, text, truncated):
        refused(gcvec("vectorize", image, "-o", tmp_path / "a.gcv"), image)


@pytest.mark.parametrize(
    ("content", "cause"),
    [
        ("<annotations><image", "photo.xml"),
        ("", "photo.xml"),
        (annotations(width=640, height=480), "640 x 480"),
        ('<annotations><image id="0" name="photo.png" width="64" height="48"/></annotations>', "photo.xml"),
        (
            annotations().replace("<polygon", "<polyline").replace("</polygon", "</polyline"),
            "2 <polyline> left out: encloses no region",
        ),
    ],
    ids=["broken", "empty", "size", "no-region", "no-region-for-a-reason"],
)
def test_bad_annotations(folder: Path, tmp_path: Path, content: str, cause: str) -> None:
    xml = tmp_path / "photo.xml"
    xml.write_text(content)
    refused(gcvec("vectorize", folder / "photo.png", "-a", xml, "-o", tmp_path / "a.gcv"), xml, cause)
    assert not (tmp_path / "a.gcv").exists()


def test_image_name(folder: Path, tmp_path: Path) -> None:
    command = ("vectorize", folder / "photo.png", "-a", folder / "photo.xml", "-o", tmp_path / "a.gcv")
    refused(gcvec(*command, "--image-name", "other.png"), "photo.xml", "other.png")
    assert gcvec(*command, "--image-name", "photo.png").returncode == 0
    alone = ("vectorize", folder / "photo.png", "-o", tmp_path / "b.gcv", "--image-name", "photo.png")
    refused(gcvec(*alone), "--image-name", "--annotations")


def test_what_cannot_be_written_is_named(folder: Path) -> None:
    done = gcvec("vectorize", folder / "photo.png", "-o", "/proc/x.gcv")
    assert done.returncode == 1
    assert done.stderr.startswith("gcvec: /proc/x.gcv: ")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "options",
    [
        ("--strategy", "fast"),
        ("--target-mse", "0"),
        ("--target-mse", "nan"),
        ("--target-mse", "low"),
        ("--max-points", "-1"),
        ("--max-points", str(2**63)),
        ("--snap", "-1"),
        ("--effort", "0"),
        ("--effort", "10"),
        ("--colour",),
        ("--report", "nowhere/r.json"),
    ],
)
def test_vectorize_refuses(folder: Path, options: tuple[str, ...]) -> None:
    refused(gcvec("vectorize", "photo.png", "-o", "b.gcv", *options, cwd=folder))
    assert not (folder / "b.gcv").exists()


def test_the_report_holds_the_warnings(folder: Path, tmp_path: Path) -> None:
    with Image.open(folder / "photo.png") as photo:
        photo.putalpha(Image.new("L", photo.size, 200))
        photo.save(tmp_path / "photo.png")
    beside = '<polygon label="far" points="900,900;950,900;950,950"/></image>'
    (tmp_path / "photo.xml").write_text(annotations().replace("</image>", beside))
    command = ("vectorize", "photo.png", "-a", "photo.xml", "-o", "a.gcv", "--regions", "7")
    run = gcvec(*command, "--report", "r.json", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    warnings = json.loads((tmp_path / "r.json").read_text())["warnings"]
    told = [line.split(": ", maxsplit=3)[-1] for line in run.stderr.splitlines()]
    assert warnings == told
    for part in ("--regions has no effect", "transparent pixels", "outside the picture"):
        assert any(part in warning for warning in warnings)


def test_a_report_without_warnings_says_so(
    folder: Path, vectorized: subprocess.CompletedProcess[str]
) -> None:
    assert vectorized.stderr == ""
    assert json.loads((folder / "r.json").read_text())["warnings"] == []


@pytest.mark.parametrize(
    ("options", "cause"),
    [
        (("-a", "photo.xml", "--regions", "7"), "--regions has no effect: the annotations say"),
        (("--snap", "1"), "--snap has no effect: there are no annotations"),
        (
            ("--target-mse", "9", "--target-bytes", "5000"),
            "--target-mse has no effect: --target-bytes decides",
        ),
        (("--effort", "3", "--strategy", "paper", "--target-mse", "50"), "--effort has no effect: it is for"),
    ],
)
def test_options_without_effect_are_named(
    folder: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    cause: str,
) -> None:
    monkeypatch.chdir(folder)
    assert run(["vectorize", "photo.png", "-o", str(tmp_path / "a.gcv"), *options]) == 0
    assert capsys.readouterr().err.startswith(f"gcvec: warning: photo.png: {cause}")


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
        ("--recolor", "0:red"),
        ("--recolor", "99:#ffffff"),
    ],
)
@pytest.mark.usefixtures("vectorized")
def test_edit_refuses(folder: Path, tmp_path: Path, options: tuple[str, ...]) -> None:
    output = tmp_path / "edited.gcv"
    refused(
        gcvec("edit", folder / "photo.gcv", "-o", output, *options), *(o.split(":")[0] for o in options[1:])
    )
    assert not output.exists()


def test_broken_vector_image(tmp_path: Path) -> None:
    broken = tmp_path / "a.gcv"
    for content in (b"", b"not a vector image", bytes(1000)):
        broken.write_bytes(content)
        refused(gcvec("render", broken, "-o", tmp_path / "a.png"), broken)


def test_unknown_command() -> None:
    refused(gcvec("vectorise"), "vectorise")


def test_help_lists_every_command() -> None:
    run = gcvec("--help")
    assert run.returncode == 0
    for command in ("compare", "render", "serve", "submit", "vectorize"):
        assert f" {command} " in run.stdout


def test_no_command_is_bad_input_and_shows_the_help() -> None:
    run = gcvec()
    assert (run.returncode, run.stdout, run.stderr) == (2, gcvec("--help").stdout, "")


def test_every_parameter_is_explained() -> None:
    context = click.Context(root)
    commands = {name: root.get_command(context, name) for name in root.list_commands(context)}
    assert {"vectorize", "serve"} < set(commands)
    for name, command in commands.items():
        assert command is not None
        assert [parameter.name for parameter in command.params if not parameter.help] == [], name


@pytest.mark.usefixtures("vectorized")
def test_failed_write_leaves_nothing(folder: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gcvec.cli", "render", folder / "photo.gcv", "-o", tmp_path / "a.json"]
    run = subprocess.run(command, capture_output=True, text=True, preexec_fn=_forbid_files_over_1_kb)
    assert (run.returncode, run.stdout) == (1, "")
    assert run.stderr.startswith("gcvec: ")
    assert run.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def _forbid_files_over_1_kb() -> None:
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))


def test_progress_bar_on_a_terminal(folder: Path, tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    command = [sys.executable, "-m", "gcvec.cli", "vectorize", "photo.png", "-o", tmp_path / "a.gcv"]
    process = subprocess.Popen(
        [*command, "-a", "photo.xml"], stderr=theirs, cwd=folder, env={**os.environ, "TERM": "xterm"}
    )
    os.close(theirs)
    shown = b""
    try:
        while chunk := os.read(ours, 65536):
            shown += chunk
    except OSError:  # how Linux says that the other end is closed
        pass
    os.close(ours)
    assert process.wait() == 0
    assert b"%" in shown
    assert b"MSE" in shown


def test_interrupt_is_quiet(tmp_path: Path) -> None:
    noise = np.random.default_rng(1).integers(0, 256, (600, 800, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "noise.png")
    command = [
        sys.executable,
        "-m",
        "gcvec.cli",
        "vectorize",
        "noise.png",
        "-o",
        "a.gcv",
        "--max-points",
        "0",
    ]
    # A shell that runs tests in the background makes its children ignore the signal.
    listen = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, cwd=tmp_path, preexec_fn=listen)
    time.sleep(1.5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert (process.returncode, errors) == (130, "")
    assert [p.name for p in tmp_path.iterdir()] == ["noise.png"]


def test_an_interrupt_before_the_work_is_quiet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("gcvec.io.read_picture", interrupted)
    (tmp_path / "a.png").touch()
    assert run(["vectorize", str(tmp_path / "a.png"), "-o", str(tmp_path / "a.gcv")]) == 130
    assert capsys.readouterr() == ("", "")


def test_an_interrupt_inside_a_kernel_is_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiled kernel returns first; then the interpreter wraps the interrupt."""

    def interrupted(*_: object, **__: object) -> None:
        try:
            raise SystemError("returned a result with an exception set") from KeyboardInterrupt()
        except SystemError as error:
            raise SystemError("and so did its caller") from error

    monkeypatch.setattr("gcvec.vectorize", interrupted)
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(tmp_path / "a.png")
    assert run(["vectorize", str(tmp_path / "a.png"), "-o", str(tmp_path / "a.gcv")]) == 130


def _pixels(path: Path) -> np.ndarray:
    with Image.open(path) as picture:
        return np.asarray(picture.convert("RGB")).astype(float)
