"""Section 2: the command line, a test a row."""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from PIL import Image

from gcvec import VectorImage
from gcvec.edit import mean_color
from gcvec.timing import STAGES
from tests.command import done, gcvec, refused
from tests.picture_files import pixels
from tests.running_service import RunningService, start_service
from tests.shaded_box import BOX, GROUND, HEIGHT, WIDTH, cvat, photo_pixels

MEASURES = {"mse", "mse_raw", "mae", "psnr", "ssim", "patches", "points", "bytes", "foldovers"}


def help_of(command: str) -> str:
    """What `--help` says, without boxes and line breaks."""
    run = done(gcvec(command, "--help", env={**os.environ, "COLUMNS": "200"}))
    return " ".join(re.sub("[│╭╮╰╯─]", " ", run.stdout).split())


@pytest.mark.contract("2: gcvec vectorize")
def test_gcvec_vectorize_writes_image_report_and_preview(folder: Path, report: dict[str, Any]) -> None:
    assert VectorImage.load(folder / "photo.gcv").labels == ("ground", "box")
    error = pixels(folder / "p.png") - photo_pixels()
    assert np.mean(error**2) == pytest.approx(report["mse"], abs=1e-6)
    assert report["mse"] <= 5


@pytest.mark.contract("2: report.json")
def test_report_json_has_every_field(folder: Path, report: dict[str, Any]) -> None:
    assert set(report) >= {"image", "seconds", "strategy", "regions", *MEASURES}
    assert report["image"] == {"width": WIDTH, "height": HEIGHT}
    assert set(report["seconds"]) >= set(STAGES)
    assert all(seconds > 0 for seconds in report["seconds"].values())
    assert report["seconds"]["total"] >= sum(report["seconds"][stage] for stage in STAGES if stage != "total")
    assert report["strategy"] == "batch"
    assert report["bytes"] == (folder / "photo.gcv").stat().st_size
    for number, region in enumerate(report["regions"]):
        assert set(region) >= {"id", "label", "points", "iterations", "mse"}
        assert region["id"] == number
    assert report["patches"] == len(report["regions"])
    assert report["points"] == sum(region["points"] for region in report["regions"])


@pytest.mark.contract("2: gcvec vectorize: defaults")
def test_gcvec_vectorize_has_the_stated_defaults(folder: Path, tmp_path: Path) -> None:
    shown = help_of("vectorize")
    assert re.search(r"--target-mse .*?\[default: 5(\.0)?\]", shown)
    assert re.search(r"--max-points .*?\[default: 2000\]", shown)
    assert re.search(r"--strategy \[?<?(batch\|paper).*?\[default: batch\]", shown)
    named = ("--strategy", "batch", "--target-mse", "5", "--max-points", "2000", "--workers", "2")
    command = ("vectorize", folder / "photo.png", "-a", folder / "photo.xml", "-o", tmp_path / "a.gcv")
    done(gcvec(*command, *named))
    assert (tmp_path / "a.gcv").read_bytes() == (folder / "photo.gcv").read_bytes()


@pytest.mark.contract("2: gcvec vectorize: no -a")
def test_gcvec_vectorize_finds_regions_by_itself(folder: Path, tmp_path: Path) -> None:
    run = gcvec("vectorize", folder / "photo.png", "-o", tmp_path / "a.gcv", "--report", tmp_path / "r.json")
    done(run)
    assert json.loads((tmp_path / "r.json").read_text())["patches"] == 2


@pytest.mark.contract("2: gcvec vectorize: --max-points")
def test_max_points_is_per_region_and_zero_lifts_it(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(90, 170, (HEIGHT, WIDTH, 3), dtype=np.uint8)
    Image.fromarray(noise).save(tmp_path / "photo.png")
    (tmp_path / "photo.xml").write_text(cvat(GROUND, BOX))
    points, told = {}, {}
    for bound in ("30", "0"):
        command = ("vectorize", "photo.png", "-a", "photo.xml", "-o", "a.gcv", "--target-mse", "250")
        run = gcvec(*command, "--max-points", bound, "--report", "r.json", cwd=tmp_path)
        assert run.returncode == 0
        told[bound] = run.stderr
        regions = json.loads((tmp_path / "r.json").read_text())["regions"]
        points[bound] = [region["points"] for region in regions]
    assert max(points["30"]) == 30
    assert sum(points["30"]) > 30
    assert max(points["0"]) > 100
    assert re.fullmatch(r"gcvec: warning: .+ above the target of 250: .* 30 control points .*\n", told["30"])
    assert told["0"] == ""


@pytest.mark.contract("2: gcvec vectorize: --strategy")
def test_the_paper_strategy_places_points_too(folder: Path, tmp_path: Path) -> None:
    command = ("vectorize", folder / "photo.png", "-a", folder / "photo.xml", "-o", "a.gcv")
    run = gcvec(*command, "--strategy", "paper", "--target-mse", "8", "--report", "r.json", cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    assert json.loads((tmp_path / "r.json").read_text())["strategy"] == "paper"


@pytest.mark.contract("2: gcvec vectorize: --image-name")
def test_image_name_picks_the_image_and_defaults_to_the_file_name(folder: Path, tmp_path: Path) -> None:
    two = (
        cvat(GROUND).replace("</annotations>", "") + cvat(BOX, name="other.png").partition("1.1</version>")[2]
    )
    (tmp_path / "two.xml").write_text(two)
    (tmp_path / "one.xml").write_text(cvat(BOX, name="other.png"))
    for name in ("photo.png", "unnamed.png"):
        (tmp_path / name).write_bytes((folder / "photo.png").read_bytes())

    def labels(picture: str, regions: str, *options: str) -> set[str]:
        done(gcvec("vectorize", picture, "-a", regions, "-o", "a.gcv", *options, cwd=tmp_path))
        return set(VectorImage.load(tmp_path / "a.gcv").labels)

    assert labels("photo.png", "two.xml") == {"ground"}
    assert labels("photo.png", "two.xml", "--image-name", "other.png") == {"box", "background"}
    assert labels("unnamed.png", "one.xml") == {"box", "background"}
    refused(gcvec("vectorize", "unnamed.png", "-a", "two.xml", "-o", "b.gcv", cwd=tmp_path), "several images")


@pytest.mark.contract("2: gcvec render")
def test_gcvec_render_writes_every_ending(folder: Path, tmp_path: Path) -> None:
    starts = {
        "png": b"\x89PNG",
        "svg": b"<?xml",
        "pdf": b"%PDF-",
        "glb": b"glTF",
        "json": b'{"format":"gcvec/1"',
    }
    for ending, start in starts.items():
        done(gcvec("render", folder / "photo.gcv", "-o", tmp_path / f"a.{ending}"))
        assert (tmp_path / f"a.{ending}").read_bytes().startswith(start), ending
    assert np.array_equal(pixels(tmp_path / "a.png"), pixels(folder / "p.png"))


@pytest.mark.contract("2: gcvec render: --scale, --raw")
def test_gcvec_render_averages_over_pixels_unless_raw(
    folder: Path, tmp_path: Path, report: dict[str, Any]
) -> None:
    for name, options in {"x3": ("--scale", "3"), "raw": ("--raw",)}.items():
        done(gcvec("render", folder / "photo.gcv", "-o", tmp_path / f"{name}.png", *options))
    large = pixels(tmp_path / "x3.png")
    assert large.shape == (3 * HEIGHT, 3 * WIDTH, 3)
    averaged = large.reshape(HEIGHT, 3, WIDTH, 3, 3).mean(axis=(1, 3))
    difference = np.abs(averaged - pixels(folder / "p.png"))  # curves are followed more closely at scale 3
    assert difference.mean() < 0.5
    assert difference.max() < 3
    raw_error = pixels(tmp_path / "raw.png") - photo_pixels()
    assert np.mean(raw_error**2) == pytest.approx(report["mse_raw"], abs=1e-6)


@pytest.mark.contract("2: gcvec compare")
def test_gcvec_compare_measures_what_the_report_says(folder: Path, report: dict[str, Any]) -> None:
    run = done(gcvec("compare", folder / "photo.png", folder / "photo.gcv", "--json"))
    measured = json.loads(run.stdout)
    assert set(measured) == MEASURES
    assert measured == pytest.approx({name: report[name] for name in MEASURES})
    assert measured["psnr"] == pytest.approx(10 * np.log10(255**2 / measured["mse"]))
    people = done(gcvec("compare", folder / "photo.png", folder / "photo.gcv")).stdout
    assert all(name in people for name in MEASURES)


@pytest.mark.contract("2: gcvec edit")
def test_gcvec_edit_moves_and_recolors(folder: Path, tmp_path: Path) -> None:
    image = VectorImage.load(folder / "photo.gcv")
    curve = next(number for number, curve in enumerate(image.curves) if not curve.on_frame)
    moves = ("--move", f"{curve}:1:.5,-.25", "--move", f"{curve}:2:-.5,0")
    colors = ("--recolor", "0:#104080", "--recolor", "1:#f0c040")
    output = tmp_path / "out.gcv"
    run = gcvec("edit", folder / "photo.gcv", "-o", output, *moves, *colors)
    assert (run.returncode, run.stdout) == (0, "")
    edited = VectorImage.load(output)
    offset = image.network.offsets[curve]
    moved = edited.foundation.control_points - image.foundation.control_points
    assert moved[[offset + 1, offset + 2]].tolist() == [[0.5, -0.25], [-0.5, 0]]
    for patch, color in ((0, (0x10, 0x40, 0x80)), (1, (0xF0, 0xC0, 0x40))):
        assert np.abs(mean_color(edited, patch) * 255 - color).max() < 5


@pytest.mark.contract("2: gcvec regions")
@pytest.mark.parametrize("ending", ["xml", "json"])
def test_gcvec_regions_feed_back(folder: Path, tmp_path: Path, ending: str) -> None:
    done(gcvec("regions", folder / "photo.png", "-o", f"r.{ending}", cwd=tmp_path))
    done(gcvec("vectorize", folder / "photo.png", "-a", f"r.{ending}", "-o", "a.gcv", cwd=tmp_path))
    assert len(VectorImage.load(tmp_path / "a.gcv").labels) == 2


@pytest.mark.service
@pytest.mark.contract("2: gcvec serve")
def test_gcvec_serve_brings_its_own_broker_unless_one_is_named(
    running_service: RunningService, tmp_path: Path, broker_url: str
) -> None:
    assert httpx.get(f"{running_service.url}/readyz").status_code == 200
    assert (running_service.data / "broker").is_dir()
    service = start_service(tmp_path / "data", "--workers", "1", GCVEC_BROKER_URL=broker_url)
    try:
        assert httpx.get(f"{service.url}/readyz").status_code == 200
        assert not (tmp_path / "data" / "broker").exists()
    finally:
        assert service.stop() == 0


@pytest.mark.service
@pytest.mark.contract("2: gcvec submit")
def test_gcvec_submit_uploads_and_downloads(
    running_service: RunningService, folder: Path, tmp_path: Path
) -> None:
    photo = (folder / "photo.png", "-a", folder / "photo.xml")
    done(gcvec("submit", *photo, "--url", running_service.url, "-o", tmp_path / "out"))
    assert {file.name for file in (tmp_path / "out").iterdir()} == {
        *("result.json", "result.gcv", "result.svg", "result.pdf", "result.glb", "report.json"),
        *("preview.png", "error.png", "patches.png"),
    }
    assert (tmp_path / "out" / "result.gcv").read_bytes() == (folder / "photo.gcv").read_bytes()


@pytest.mark.contract("2: no progress bar in a pipe")
def test_progress_bars_are_for_terminals(folder: Path, tmp_path: Path) -> None:
    """A bar on a terminal: tests/gcvec/cli/test_progress.py."""
    run = gcvec("vectorize", folder / "photo.png", "-o", tmp_path / "a.gcv")
    assert (run.stdout, run.stderr) == ("", "")


@pytest.mark.contract("2: errors, exit 2")
@pytest.mark.parametrize(
    ("command", "named"),
    [
        (("vectorize", "missing.png", "-o", "a.gcv"), "missing.png"),
        (("vectorize", "notes.txt", "-o", "a.gcv"), "notes.txt"),
        (("vectorize", "damaged.tif", "-o", "a.gcv"), "damaged.tif"),
        (("vectorize", "photo.png", "-a", "broken.xml", "-o", "a.gcv"), "broken.xml"),
        (("vectorize", "photo.png", "-o", "nowhere/a.gcv"), "nowhere"),
        (("vectorize", "photo.png", "-o", "a.gcv", "--target-mse", "-1"), "target_mse"),
        (("vectorize", "photo.png", "-o", "a.gcv", "--matte", "white"), "GCVEC_MATTE"),
        (("render", "notes.txt", "-o", "a.png"), "notes.txt"),
        (("render", "photo.gcv", "-o", "a.bmp"), "a.bmp"),
        (("compare", "photo.png", "notes.txt"), "notes.txt"),
        (("edit", "photo.gcv", "-o", "a.gcv", "--move", "999:0:1,1"), "curve 999"),
        (("regions", "notes.txt", "-o", "a.xml"), "notes.txt"),
        (("serve", "--host", "0.0.0.0"), "0.0.0.0"),
        (("submit", "missing.png", "--url", "http://127.0.0.1:9", "-o", "out"), "missing.png"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, tuple) else None,
)
def test_bad_input_is_one_line_that_names_it_and_exit_code_2(
    folder: Path, tmp_path: Path, command: tuple[str, ...], named: str
) -> None:
    for name in ("photo.png", "photo.gcv"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    (tmp_path / "notes.txt").write_text("neither a picture nor a vector image")
    (tmp_path / "broken.xml").write_text("<annotations><image")
    (tmp_path / "damaged.tif").write_bytes(damaged_tiff())
    before = set(tmp_path.iterdir())
    refused(gcvec(*command, cwd=tmp_path), named)
    assert set(tmp_path.iterdir()) == before


def damaged_tiff() -> bytes:
    """A TIFF about whose pixels libtiff itself would complain on stderr."""
    noise = np.random.default_rng(0).integers(0, 256, (60, 60, 3), dtype=np.uint8)
    buffer = io.BytesIO()
    Image.fromarray(noise).save(buffer, "TIFF", compression="tiff_lzw")
    data = bytearray(buffer.getvalue())
    data[3000:4000] = bytes((7 * value + 13) % 256 for value in data[3000:4000])
    return bytes(data)


@pytest.mark.contract("2: errors, exit 1")
def test_a_failure_is_one_line_and_exit_code_1(folder: Path, tmp_path: Path) -> None:
    """A service that does not answer; for a disk that is full see tests/gcvec/cli/test_render.py."""
    run = gcvec("submit", folder / "photo.png", "--url", "http://127.0.0.1:9", "-o", tmp_path / "out")
    assert (run.returncode, run.stdout) == (1, "")
    assert re.fullmatch(r"gcvec: http://127\.0\.0\.1:9: .+\n", run.stderr)


@pytest.mark.contract("2: the command is installed")
def test_the_command_is_gcvec() -> None:
    script = Path(sys.executable).with_name("gcvec")
    shown = subprocess.run([script, "--help"], capture_output=True, text=True, timeout=60, check=True).stdout
    for command in ("vectorize", "render", "compare", "edit", "regions", "serve", "submit"):
        assert re.search(rf"\b{command}\b", shown)
