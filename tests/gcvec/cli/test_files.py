"""Files as the command line writes them: what they may be, and what is never written over."""

from __future__ import annotations

import os
import shutil
import stat
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from gcvec.cli._app import run
from gcvec.cli._files import check_files, write

NOBODY = 65534


def exit_code(*arguments: object) -> int:
    return run([str(argument) for argument in arguments])


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    path = tmp_path / "photo"  # pictures are told apart by content
    Image.fromarray(np.full((8, 9, 3), 90, np.uint8)).save(path, "PNG")
    return path


@pytest.fixture
def closed(monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that may not be written, with a file `open` in it that may and one `shut` that may not."""
    folder = Path(tempfile.mkdtemp())  # pytest's own folders are closed to others altogether
    for name, mode in (("open", 0o666), ("shut", 0o444)):
        (folder / name).write_bytes(b"before")
        (folder / name).chmod(mode)
    folder.chmod(0o555)
    root = os.getuid() == 0
    if root:  # who may write everywhere
        os.setresuid(NOBODY, NOBODY, 0)
    yield folder
    if root:
        os.setresuid(0, 0, 0)
    folder.chmod(0o755)
    shutil.rmtree(folder)


def test_a_pipe_is_written_into(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    received: list[bytes] = []
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()))
    reader.start()
    write(pipe, b"content")
    reader.join(timeout=10)
    assert received == [b"content"]
    assert pipe.is_fifo()


def test_a_device_stays_one() -> None:
    ours, theirs = os.openpty()
    device = Path(os.ttyname(theirs))
    write(device, b"content")
    assert device.is_char_device()
    assert os.read(ours, 100) == b"content"
    os.close(ours)
    os.close(theirs)


@pytest.mark.parametrize("existing", [True, False])
def test_a_link_stays_one_and_what_it_leads_to_is_written(tmp_path: Path, existing: bool) -> None:
    target, link = tmp_path / "elsewhere" / "target", tmp_path / "link"
    target.parent.mkdir()
    if existing:
        target.write_bytes(b"before")
    link.symlink_to(target)
    write(link, b"after")
    assert link.is_symlink()
    assert target.read_bytes() == b"after"


def test_whoever_may_read_a_file_still_may_when_it_is_replaced_and_nobody_else(tmp_path: Path) -> None:
    path = tmp_path / "out.gcv"
    umask = os.umask(0o027)
    write(path, b"new")
    os.umask(umask)
    assert stat.S_IMODE(path.stat().st_mode) == 0o640
    path.chmod(0o600)
    write(path, b"newer")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert path.read_bytes() == b"newer"


def test_a_link_into_no_folder_is_refused(
    photo: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    link = tmp_path / "link.gcv"
    link.symlink_to(tmp_path / "missing" / "a.gcv")
    assert exit_code("vectorize", photo, "-o", link) == 2
    assert "no such folder" in capsys.readouterr().err


@pytest.mark.parametrize(
    "command",
    [
        "vectorize photo -o loop",
        "vectorize photo -o loop/a.gcv",
        "vectorize photo -o a.gcv --report back",
        "vectorize loop -o a.gcv",
        "vectorize photo -a back -o a.gcv",
    ],
)
def test_a_link_back_to_itself_is_refused(
    photo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(photo.parent)
    for link, target in (("loop", "loop"), ("there", "back"), ("back", "there")):
        Path(link).symlink_to(target)
    assert exit_code(*command.split()) == 2
    told = capsys.readouterr().err
    assert "leads back to itself" in told or "does not exist" in told
    assert told.count("\n") == 1
    assert not Path("a.gcv").exists()


@pytest.mark.parametrize("output", ["new/", "new/er/", "there/", "there//", "set.png/", "./"])
def test_a_slash_at_the_end_means_a_folder(
    photo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], output: str
) -> None:
    monkeypatch.chdir(photo.parent)
    photo.rename("a.photo.png")
    Path("there").mkdir()
    assert exit_code("vectorize", "a.photo.png", "-o", output) == 0
    made = Path(output, "a.photo.gcv")
    before = made.read_bytes()
    assert before.startswith(b"GCV")
    assert exit_code("edit", made, "-o", output, "--recolor", "0:#204060") == 0  # in place
    assert made.read_bytes() != before
    assert sorted(path.name for path in made.parent.iterdir() if path.suffix == ".gcv") == ["a.photo.gcv"]


@pytest.mark.parametrize(
    "command",
    [
        "vectorize photo -o photo/",
        "vectorize photo -o photo/new/",
        "vectorize - -o new/",
        "edit - -o new/ --recolor 0:#204060",
        "vectorize photo -o a.gcv --report new/",
        "vectorize photo -o a.gcv --preview new.png/",
        "regions photo -o new.xml/",
        "render photo -o new.png/",
    ],
)
def test_what_a_folder_will_not_do_for_is_refused(
    photo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(photo.parent)
    assert exit_code(*command.split()) == 2
    told = capsys.readouterr().err
    assert "folder" in told or "no name" in told
    assert told.count("\n") == 1
    assert list(photo.parent.iterdir()) == [photo]


def test_what_may_not_be_written_is_told_before_the_work(closed: Path) -> None:
    for name in ("new", "shut"):
        with pytest.raises(PermissionError) as told:
            check_files(outputs=(closed / name,))
        assert told.value.filename == str(closed / name)
        with pytest.raises(PermissionError):
            write(closed / name, b"after")
    assert sorted(path.name for path in closed.iterdir()) == ["open", "shut"]


def test_a_file_that_may_be_written_is_where_its_folder_may_not(closed: Path) -> None:
    check_files(outputs=(closed / "open",))
    write(closed / "open", b"after")
    assert (closed / "open").read_bytes() == b"after"


@pytest.mark.parametrize(
    "command",
    [
        "vectorize photo -o photo",
        "vectorize photo -o ./photo",
        "vectorize photo -o linked",
        "vectorize photo.png -o out.gcv --preview photo.png",
        "vectorize photo -a regions.xml -o regions.xml",
        "vectorize photo -a regions.xml -o out.gcv --report regions.xml",
        "vectorize photo -o out.gcv --report out.gcv",
        "vectorize photo -o out.gcv --report new.png --preview ../{folder}/new.png",
        "regions photo.xml -o photo.xml",
        "render drawn.png -o drawn.png",
    ],
)
def test_no_command_writes_over_what_it_reads_or_writes(
    photo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    folder = photo.parent
    monkeypatch.chdir(folder)
    (folder / "linked").symlink_to(photo)
    for ending in (".png", ".xml"):
        photo.with_suffix(ending).write_bytes(photo.read_bytes())
    assert exit_code("regions", photo, "-o", "regions.xml") == 0
    assert exit_code("vectorize", photo, "-o", "drawn.gcv") == 0
    (folder / "drawn.gcv").rename("drawn.png")
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert exit_code(*command.format(folder=folder.name).split()) == 2
    assert "another file of this command" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


@pytest.mark.parametrize(
    "command",
    [
        "vectorize - -a - -o out.gcv",
        "vectorize photo -o - --report -",
        "compare - -",
    ],
)
def test_a_standard_stream_is_for_one_file(
    photo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(photo.parent)
    assert exit_code(*command.split()) == 2
    assert "one file only" in capsys.readouterr().err
    assert list(photo.parent.iterdir()) == [photo]


@pytest.mark.parametrize(
    "command",
    [
        *(f"vectorize photo -o out.{ending}" for ending in ("png", "JPG", "webp", "tif", "svg", "json")),
        "edit photo -o out.png --recolor 0:#204060",
        *(f"vectorize photo -o out.gcv --preview out.{ending}" for ending in ("jpg", "gcv")),
        "vectorize photo -o out.gcv --preview out",
    ],
)
def test_what_is_written_is_what_the_ending_promises(
    photo: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    monkeypatch.chdir(photo.parent)
    assert exit_code(*command.split()) == 2
    assert "out" in capsys.readouterr().err
    assert list(photo.parent.iterdir()) == [photo]


def test_a_vector_image_may_have_any_other_name(photo: Path, tmp_path: Path) -> None:
    for name in ("plain", "photo.gcv.new", "photo.v1"):
        assert exit_code("vectorize", photo, "-o", tmp_path / name) == 0


@pytest.mark.parametrize("name", ["n" * 255, "日" * 85])
def test_a_name_may_be_as_long_as_the_folder_allows(photo: Path, tmp_path: Path, name: str) -> None:
    assert exit_code("vectorize", photo, "-o", tmp_path / name) == 0
    assert (tmp_path / name).read_bytes().startswith(b"GCV")


def test_several_outputs_may_go_to_nowhere(photo: Path) -> None:
    assert exit_code("vectorize", photo, "-o", os.devnull, "--report", os.devnull) == 0
    assert Path(os.devnull).is_char_device()


def test_an_edit_may_be_written_in_place(photo: Path, tmp_path: Path) -> None:
    image = tmp_path / "a.gcv"
    assert exit_code("vectorize", photo, "-o", image) == 0
    before = image.read_bytes()
    assert exit_code("edit", image, "-o", image, "--recolor", "0:#204060") == 0
    assert image.read_bytes() != before
