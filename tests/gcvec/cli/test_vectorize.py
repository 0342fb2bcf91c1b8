"""`gcvec vectorize`: what it writes, says and refuses."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage
from gcvec.cli._app import run
from tests.command import gcvec, refused
from tests.picture_files import pixels
from tests.shaded_box import BOX, GROUND, HEIGHT, WIDTH, cvat


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
    error = pixels(folder / "p.png") - pixels(folder / "photo.png")
    assert np.mean(error**2) == pytest.approx(report["mse"], abs=0.05)
    assert sorted(p.name for p in folder.iterdir() if p.name.startswith(".")) == []


def test_the_report_holds_the_warnings(folder: Path, tmp_path: Path) -> None:
    with Image.open(folder / "photo.png") as photo:
        photo.putalpha(Image.new("L", photo.size, 200))
        photo.save(tmp_path / "photo.png")
    beside = '<polygon label="far" points="900,900;950,900;950,950"/></image>'
    (tmp_path / "photo.xml").write_text(cvat(GROUND, BOX).replace("</image>", beside))
    command = ("vectorize", "photo.png", "-a", "photo.xml", "-o", "a.gcv", "--regions", "7")
    run = gcvec(*command, "--report", "r.json", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    warnings = json.loads((tmp_path / "r.json").read_text())["warnings"]
    told = [line.split(": ", maxsplit=3)[-1] for line in run.stderr.splitlines()]
    assert warnings == told
    for part in ("--regions has no effect", "transparent pixels", "outside the picture"):
        assert any(part in warning for warning in warnings)


def test_warnings_name_the_file_that_they_are_about(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    beside = '<polygon label="far" points="900,900;950,900;950,950"/></image>'
    (tmp_path / "drawn.xml").write_text(cvat(GROUND, BOX).replace("</image>", beside))
    (tmp_path / "photo.png").write_bytes((folder / "photo.png").read_bytes())
    monkeypatch.chdir(tmp_path)
    options = ("--target-mse", "0.2", "--max-points", "1", "--snap", "0")
    assert run(["vectorize", "photo.png", "-a", "drawn.xml", "-o", "a.gcv", *options]) == 0
    dropped, missed = capsys.readouterr().err.splitlines()
    assert dropped.startswith("gcvec: warning: drawn.xml: 1 shape dropped: outside the picture")
    assert missed.startswith("gcvec: warning: photo.png: the mean squared error stays at")


def test_an_error_about_the_result_names_the_picture(folder: Path, tmp_path: Path) -> None:
    command = ("vectorize", "photo.png", "-a", "photo.xml", "-o", tmp_path / "a.gcv", "--target-bytes", "50")
    refused(gcvec(*command, cwd=folder), "gcvec: photo.png: the picture does not fit into 50 bytes")


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


def test_image_name(folder: Path, tmp_path: Path) -> None:
    command = ("vectorize", folder / "photo.png", "-a", folder / "photo.xml", "-o", tmp_path / "a.gcv")
    refused(gcvec(*command, "--image-name", "other.png"), "photo.xml", "other.png")
    assert gcvec(*command, "--image-name", "photo.png").returncode == 0
    alone = ("vectorize", folder / "photo.png", "-o", tmp_path / "b.gcv", "--image-name", "photo.png")
    refused(gcvec(*alone), "--image-name", "--annotations")


def test_folders_tell_images_of_one_name_apart(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    trained, tested = (
        cvat(shape, name=f"{name}/photo.png") for shape, name in ((GROUND, "train"), (BOX, "test"))
    )
    xml = tmp_path / "both.xml"
    xml.write_text(trained.replace("</annotations>", "") + tested.partition("1.1</version>")[2])
    for name in ("train", "test", "other"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "photo.png").write_bytes((folder / "photo.png").read_bytes())
    monkeypatch.chdir(tmp_path / "test")
    for picture, labels in (("photo.png", {"box", "background"}), ("../train/photo.png", {"ground"})):
        assert run(["vectorize", picture, "-a", "../both.xml", "-o", "a.gcv"]) == 0
        assert set(VectorImage.load("a.gcv").labels) == labels
    assert run(["vectorize", "../other/photo.png", "-a", "../both.xml", "-o", "a.gcv"]) == 2
    assert "several images match 'photo.png'" in capsys.readouterr().err


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
        (cvat(GROUND, BOX, width=640, height=480), "640 x 480"),
        ('<annotations><image id="0" name="photo.png" width="64" height="48"/></annotations>', "photo.xml"),
        (
            cvat(GROUND, BOX).replace("<polygon", "<polyline").replace("</polygon", "</polyline"),
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


def test_what_cannot_be_written_is_named(folder: Path) -> None:
    done = gcvec("vectorize", folder / "photo.png", "-o", "/proc/x.gcv")
    assert done.returncode == 1
    assert done.stderr.startswith("gcvec: /proc/x.gcv: ")
    assert done.stderr.count("\n") == 1
