"""Every example runs, shows what it says in numbers, and writes its figure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from examples import (
    ex01_concave_quad,
    ex02_regular_hexagon,
    ex03_offset_sampling,
    ex04_stages,
    ex05_results,
    ex06_move_control_points,
    ex07_recolor,
    ex08_foldover_study,
    figures,
)
from examples.coons import classical_coons, corners, generalized_coons, line


@pytest.fixture(autouse=True)
def figure_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Figures go elsewhere than docs/figures."""
    monkeypatch.setattr(figures, "FOLDER", tmp_path)
    return tmp_path


def size_of_figure(folder: Path, name: str) -> tuple[int, int]:
    """Width and height of a figure, which is a small file."""
    path = folder / f"{name}.png"
    assert path.stat().st_size < 100_000
    with Image.open(path) as picture:
        return picture.size


def test_patches_are_the_identity_on_straight_edges() -> None:
    """What both constructions have in common, so that the examples compare like with like."""
    square = np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
    curves = [line(a, b) for a, b in zip(square, np.roll(square, -1, axis=0), strict=True)]
    for patch in (classical_coons(curves), generalized_coons(corners(curves), curves)):
        np.testing.assert_allclose(patch.image, patch.domain, atol=1e-9)
        assert not patch.flipped.any()


def test_a_classical_patch_folds_over_a_concave_quad(figure_folder: Path) -> None:
    result = ex01_concave_quad.main()
    assert result["classical flipped"] > 0.05 * result["classical triangles"]
    assert result["generalized flipped"] == 0
    assert result["generalized triangles"] > 200
    assert size_of_figure(figure_folder, "concave_quad") > (200, 100)


def test_a_regular_hexagon_folds(figure_folder: Path) -> None:
    result = ex02_regular_hexagon.main()
    assert result["regular flipped"] > 100
    assert result["adapted flipped"] == 0
    assert size_of_figure(figure_folder, "regular_hexagon") > (200, 100)


@pytest.mark.slow
def test_offset_sampling_saves_points(figure_folder: Path) -> None:
    result = ex03_offset_sampling.main()
    assert result["mse inside"] < 0.5 * result["mse on the curve"]
    assert result["points inside"] < 0.9 * result["points on the curve"]
    assert size_of_figure(figure_folder, "offset_sampling") > (200, 100)


def test_stages(figure_folder: Path) -> None:
    result = ex04_stages.main()
    assert result["patches"] == 7
    assert result["foldovers"] == 0
    assert 0 < result["points"] < 400
    assert result["hard curves"] >= 6
    assert size_of_figure(figure_folder, "stages") == (4 * 240 + 3 * figures.GAP, 2 * 180 + figures.GAP)


def test_results(figure_folder: Path) -> None:
    result = ex05_results.main()
    assert result["MSE"] == pytest.approx(result["MSE measured"])
    assert result["MSE"] <= 2.0
    assert result["storage (KB)"] < 3.0
    assert result["total"] > result["evaluation"]
    assert size_of_figure(figure_folder, "results") > (200, 100)


def test_moving_control_points(figure_folder: Path) -> None:
    result = ex06_move_control_points.main()
    assert result["largest move"] > 10
    assert result["foldovers"] == 0
    assert 0.02 < result["changed"] < 0.95
    assert size_of_figure(figure_folder, "move_control_points") > (200, 100)


def test_recoloring(figure_folder: Path) -> None:
    result = ex07_recolor.main()
    assert result["off"] < 4
    assert 0.05 < result["changed"] < 0.2
    assert result["foldovers"] == 0
    assert size_of_figure(figure_folder, "recolor") > (200, 100)


@pytest.mark.slow
def test_foldover_study(figure_folder: Path) -> None:
    result = ex08_foldover_study.main()
    assert result["regions"] >= 1000
    assert result["regular"] > 0.5 > result["coarse"] > result["default"] == 0
    assert size_of_figure(figure_folder, "foldover_study") > (200, 100)
