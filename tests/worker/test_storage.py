from __future__ import annotations

import time
from pathlib import Path

import obstore
import pytest
from obstore.store import ObjectStore

from worker import storage
from worker.storage import Manifest


@pytest.fixture
def store(tmp_path: Path) -> ObjectStore:
    return storage.open_store((tmp_path / "a folder").as_uri())


def test_what_is_written_is_read(store: ObjectStore) -> None:
    file = storage.write(store, "jobs/x/a", b"abc")
    assert storage.read(store, file.path) == b"abc"
    assert file.size == 3
    assert file.sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_reading_what_is_not_there_says_so(store: ObjectStore) -> None:
    with pytest.raises(FileNotFoundError):
        storage.read(store, "jobs/x/a")
    assert storage.read_manifest(store, "x") is None


def test_the_first_complete_result_stays(store: ObjectStore) -> None:
    first = Manifest(1, {"gcv": storage.write(store, "jobs/x/attempt-1/g", b"1")}, ("careful",))
    second = Manifest(2, {"gcv": storage.write(store, "jobs/x/attempt-2/g", b"2")})
    assert storage.commit(store, "x", first)
    assert not storage.commit(store, "x", second)
    assert storage.read_manifest(store, "x") == first


def test_only_the_folder_itself_is_deleted(store: ObjectStore) -> None:
    for path in ("jobs/x/input/image", "jobs/x/attempt-1/a", "jobs/x/attempt-10/a", "jobs/xy/a"):
        storage.write(store, path, b"1")
    storage.delete_folder(store, storage.attempt_folder("x", 1))
    left = sorted(entry["path"] for page in obstore.list(store) for entry in page)
    assert left == ["jobs/x/attempt-10/a", "jobs/x/input/image", "jobs/xy/a"]
    storage.delete_folder(store, storage.job_folder("x"))
    storage.delete_folder(store, storage.job_folder("x"))
    left = [entry["path"] for page in obstore.list(store) for entry in page]
    assert left == ["jobs/xy/a"]


def test_folders_of_files_that_could_not_be_written_go_too(store: ObjectStore, tmp_path: Path) -> None:
    jobs = tmp_path / "a folder" / "jobs"
    (jobs / "x" / "attempt-1").mkdir(parents=True)
    (jobs / "y" / "input").mkdir(parents=True)
    storage.write(store, storage.image_path("x"), b"1")
    storage.delete_folder(store, storage.attempt_folder("x", 1))
    assert [place.name for place in (jobs / "x").iterdir()] == ["input"]
    storage.delete_folder(store, storage.job_folder("y"))
    assert [place.name for place in jobs.iterdir()] == ["x"]


def test_what_is_left_of_a_write_that_was_broken_off_goes_too(store: ObjectStore, tmp_path: Path) -> None:
    """The store itself does not list it."""
    jobs = tmp_path / "a folder" / "jobs"
    storage.write(store, storage.image_path("x"), b"1")
    for folder in (jobs / "x" / "input", jobs / "y" / "attempt-1"):
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "image#1").write_bytes(b"half")
    assert time.time() - storage.last_written(store, storage.job_folder("y")) < 60
    for job_id in ("x", "y"):
        storage.delete_folder(store, storage.job_folder(job_id))
    assert list(jobs.iterdir()) == []
    assert storage.last_written(store, storage.job_folder("y")) == 0
