"""Where a job's files live: one folder a job, in a local folder or an S3 bucket.

jobs/ID/input/image, annotations     what was uploaded
jobs/ID/attempt-N/...                what attempt N wrote; invisible until the manifest names it
jobs/ID/manifest.json                the commit: created once, by the first attempt that is complete
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import obstore
from obstore.exceptions import AlreadyExistsError
from obstore.store import ObjectStore, from_url


@dataclass(frozen=True)
class StoredFile:
    """A file as the manifest names it: place in the store, size in bytes, SHA-256 of the content."""

    path: str
    size: int
    sha256: str


@dataclass(frozen=True)
class Manifest:
    """A complete result: its files by artefact name, and what the run warned of."""

    attempt: int
    files: dict[str, StoredFile]
    warnings: tuple[str, ...] = ()

    def to_json(self) -> bytes:
        return json.dumps(asdict(self)).encode()

    @classmethod
    def from_json(cls, data: bytes) -> Manifest:
        fields = json.loads(data)
        files = {name: StoredFile(**file) for name, file in fields["files"].items()}
        return cls(fields["attempt"], files, tuple(fields["warnings"]))


def open_store(url: str) -> ObjectStore:
    """The object store at `url` (``file:///folder`` or ``s3://bucket/prefix``)."""
    if url.startswith("file:"):
        return from_url(url, mkdir=True, automatic_cleanup=True)
    return from_url(url)


def job_folder(job_id: str) -> str:
    return f"jobs/{job_id}"


def image_path(job_id: str) -> str:
    return f"{job_folder(job_id)}/input/image"


def annotations_path(job_id: str) -> str:
    return f"{job_folder(job_id)}/input/annotations"


def attempt_folder(job_id: str, attempt: int) -> str:
    return f"{job_folder(job_id)}/attempt-{attempt}"


def manifest_path(job_id: str) -> str:
    return f"{job_folder(job_id)}/manifest.json"


def read(store: ObjectStore, path: str) -> bytes:
    """The content at `path`. Raises FileNotFoundError where there is none."""
    return bytes(obstore.get(store, path).bytes())


def write(store: ObjectStore, path: str, data: bytes) -> StoredFile:
    """Store `data` at `path`, whole or not at all."""
    obstore.put(store, path, data)
    return StoredFile(path, len(data), hashlib.sha256(data).hexdigest())


def read_manifest(store: ObjectStore, job_id: str) -> Manifest | None:
    """The job's manifest, or None while no attempt has completed."""
    try:
        return Manifest.from_json(read(store, manifest_path(job_id)))
    except FileNotFoundError:
        return None


def commit(store: ObjectStore, job_id: str, manifest: Manifest) -> bool:
    """Make a result visible, all at once; False if another attempt has done so before."""
    try:
        obstore.put(store, manifest_path(job_id), manifest.to_json(), mode="create")
    except AlreadyExistsError:
        return False
    return True


def delete_folder(store: ObjectStore, folder: str) -> None:
    """Delete everything under `folder`; nothing there is fine."""
    for paths in _pages(store, folder):
        obstore.delete(store, paths)


def _pages(store: ObjectStore, folder: str) -> Iterator[list[str]]:
    for page in obstore.list(store, prefix=folder, chunk_size=1000):
        yield [entry["path"] for entry in page]
