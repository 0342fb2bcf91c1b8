"""The benchmarks run in short, and a measurement that fails is told as such."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks import delaunay_gouraud
from benchmarks.codecs import CODECS, sizes
from benchmarks.growth import exponent
from benchmarks.pictures import FILES, picture
from benchmarks.plan import FULL, up_to
from benchmarks.run import Run

ROOT = Path(__file__).parents[2]


def rows(page: str, section: str) -> list[list[str]]:
    """The cells of a section's table, heading first."""
    text = page.partition(f"## {section}")[2].partition("\n## ")[0]
    lines = [line for line in text.splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in line[1:-1].split("|")] for line in lines if "---" not in line]


def number(cell: str) -> float:
    return float(cell.replace(",", ""))


def test_the_short_form_fills_every_table(tmp_path: Path) -> None:
    output = tmp_path / "benchmarks.md"
    command = [sys.executable, "-m", "benchmarks", "--quick", "--output", str(output)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    page = output.read_text()
    assert run.stdout == f"{page}\n"
    assert re.search(r"Machine: .+ cores, \d+ GiB .+ Python 3.+ numpy ", page)
    heading, stages = rows(page, "Seconds by stage")
    seconds = {name: number(cell) for name, cell in zip(heading, stages, strict=True) if name.endswith(", s")}
    assert sum(seconds.values()) - seconds["total, s"] == pytest.approx(seconds["total, s"], rel=0.25)
    assert number(stages[heading.index("peak, MB")]) > 50
    heading, tiny, whole = rows(page, "`gcvec vectorize` from start to end")
    assert number(tiny[heading.index("seconds")]) > 0.1
    assert number(whole[heading.index("seconds")]) > seconds["total, s"] / 2
    assert len(rows(page, "Growth")) == 3
    assert re.search(
        r"exponents: time -?\d\.\d\d, memory above the idle engine's (unknown|-?\d+\.\d\d)", page
    )
    heading, sizes = rows(page, "Points and kilobytes")
    assert {*CODECS, "gcvec", "Delaunay-Gouraud"} < set(heading)
    for name in ("gcvec", *CODECS, "Delaunay-Gouraud", "gcvec, points", "Delaunay-Gouraud, points"):
        assert number(sizes[heading.index(name)]) > 0
    assert re.fullmatch(r"[\d.]+|\([\d.]+: [\d.]+\)", sizes[heading.index("vtracer, gzip")])
    assert len(rows(page, "Efforts")) == 3
    _, edits = rows(page, "Edits")
    assert all(number(cell) > 0 for cell in edits[1:])
    heading, row = rows(page, "The paper's strategy")
    paper = dict(zip(heading, row, strict=True))
    assert number(paper["error"]) <= number(paper["error, paper"])
    assert number(paper["points"]) < number(paper["points, paper"])
    assert number(paper["times as fast"]) > 1


def fails() -> None:
    raise ValueError("no figures today")


def sleeps() -> None:
    time.sleep(60)


def grasps() -> int:
    return int(np.ones(10**9).sum())


def works(value: int) -> dict[str, int]:
    return {"value": value}


def test_a_measurement_that_fails_does_not_end_the_run() -> None:
    run = Run(seconds=300, memory=2_000_000_000)
    assert run.measure(fails).failure == "ValueError: no figures today"
    assert Run(seconds=300, longest=2).measure(sleeps).failure == "longer than 2 s"
    assert run.measure(grasps).failure == "more than 2.0 GB of memory"
    outcome = run.measure(works, value=3)
    assert (outcome.value, outcome.failure) == ({"value": 3}, "")
    assert outcome.peak > 1_000_000


def test_what_comes_too_late_is_left_out() -> None:
    assert "left out" in Run(seconds=0).measure(works, value=3).failure


def test_pictures_have_the_size_asked_for() -> None:
    for name in FILES:
        height, width, channels = picture(name, 0.03).shape
        assert channels == 3
        assert width * height == pytest.approx(30_000, rel=0.02)


def test_a_plain_mesh_reaches_its_targets_and_pays_for_it() -> None:
    loose, tight = delaunay_gouraud.sizes("chelsea", 0.005, (100, 20))
    assert 70 < loose["mse"] <= 100
    assert 14 < tight["mse"] <= 20
    assert loose["points"] < tight["points"]
    assert loose["bytes"] < tight["bytes"]
    with_all = delaunay_gouraud.sizes("chelsea", 0.0005, (1e-9,))[0]
    assert with_all["mse"] > 1e-9


@pytest.mark.parametrize("codec", CODECS)
def test_codecs_are_as_small_as_the_target_lets_them(codec: str) -> None:
    loose, tight = sizes("chelsea", 0.01, codec, (60, 30))
    assert loose["mse"] <= 60
    assert tight["mse"] <= 30
    assert loose["bytes"] < tight["bytes"]
    (best,) = sizes("chelsea", 0.01, codec, (1e-9,))
    assert best["mse"] > 1e-9


def test_exponents_are_those_of_power_laws() -> None:
    assert exponent([1, 2, 4], [3, 12, 48]) == pytest.approx(2)
    assert exponent([1], [3]) is None


def test_what_is_too_little_to_measure_has_no_exponent() -> None:
    assert exponent([1, 2, 4, 8], [0, 5, 20, 80], least=2) == pytest.approx(2)
    assert exponent([1, 2, 4], [0, -1, 20], least=2) is None


def test_larger_pictures_can_be_left_out() -> None:
    assert FULL.growth_sizes[-1] == 12
    assert up_to(3, FULL).growth_sizes == (0.1, 0.3, 1, 3)
