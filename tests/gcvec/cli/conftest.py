"""A photo and its regions in a folder, as a user has them."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from PIL import Image

from tests.command import gcvec
from tests.shaded_box import BOX, GROUND, cvat, photo_pixels


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo with its regions."""
    folder = tmp_path_factory.mktemp("cli")
    Image.fromarray(photo_pixels()).save(folder / "photo.png")
    (folder / "photo.xml").write_text(cvat(GROUND, BOX))
    return folder


@pytest.fixture(scope="session")
def vectorized(folder: Path) -> subprocess.CompletedProcess[str]:
    """The run that has put a vector image, its report and its preview into the folder."""
    files = ("photo.png", "-a", "photo.xml", "-o", "photo.gcv", "--report", "r.json", "--preview", "p.png")
    return gcvec("vectorize", *files, cwd=folder)
