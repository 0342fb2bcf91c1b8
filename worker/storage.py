"""Where a job's files live: one folder a job, in a local folder or an S3 bucket.

jobs/ID/input/image, annotations     what was uploaded
jobs/ID/attempt-N/...                what attempt N wrote; invisible until the manifest names it
jobs/ID/attempt-N/round-R/P.request, P.result   part P of a picture that is shared out, while it is
jobs/ID/manifest.json                the commit: created once, by the first attempt that is complete
jobs/ID/revisions/R/...              what an edit made, again with a manifest; R is 1, 2, …; 0 is the original
jobs/ID/revisions/R/derived/...      made of revision R on demand: NAME, and NAME.json once it is whole
redis.id                             which Redis has the records of these jobs
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from datetime import timedelta
from pathlib import Path
from tempfile import TemporaryFile
from typing import Final
from urllib.parse import unquote, urlsplit

import obstore
from obstore.exceptions import AlreadyExistsError
from obstore.store import LocalStore, ObjectStore, S3Store, from_url

from gcvec.errors import InputError
from worker.fields import known_fields
from worker.settings import Settings

_OUTAGE_SECONDS: Final = 8
"""A bucket that is away for longer fails the step."""
_REDIS_ID: Final = "redis.id"
_BYTES: Final = "application/octet-stream"


@dataclass(frozen=True)
class StoredFile:
    """A file as the manifest names it: place in the store, size in bytes, SHA-256 of the content."""

    path: str
    size: int
    sha256: str


@dataclass(frozen=True)
class Manifest:
    """A complete result: files by artefact name, what the run warned of, what it adds to the totals."""

    attempt: int
    files: dict[str, StoredFile]
    warnings: tuple[str, ...] = ()
    totals: dict[str, float] = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Bytes of all files together."""
        return sum(file.size for file in self.files.values())

    def to_json(self) -> bytes:
        return json.dumps(asdict(self)).encode()

    @classmethod
    def from_json(cls, data: bytes) -> Manifest:
        fields = json.loads(data)
        files = {name: StoredFile(**known_fields(StoredFile, file)) for name, file in fields["files"].items()}
        return cls(fields["attempt"], files, tuple(fields["warnings"]), fields["totals"])


def open_store(url: str) -> ObjectStore:
    """The object store at `url` (``file:///folder`` or ``s3://bucket/prefix``).

    A bucket's address and credentials are read from the AWS_... variables, as other programs read them.
    """
    if url.startswith("file:"):
        return from_url(url, mkdir=True, automatic_cleanup=True)
    return from_url(
        url,
        retry_config={"max_retries": 4, "retry_timeout": timedelta(seconds=_OUTAGE_SECONDS)},
    )


def require_folder(settings: Settings) -> None:
    """Make the folder for the files, if there is none. Raises InputError unless it can be written to.

    A disk that is full is no reason: deleting jobs makes room. A bucket is not asked for here.
    """
    parts = urlsplit(settings.storage)
    if parts.scheme != "file":
        return
    folder = Path(unquote(parts.path))
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder):
            pass
    except OSError as error:
        if error.errno in (errno.ENOSPC, errno.EDQUOT):
            return
        setting = "GCVEC_STORAGE_URL" if settings.storage_url else "GCVEC_DATA_DIR"
        reason = error.strerror or str(error)
        raise InputError(f"{setting}: {folder} cannot be written to: {reason}", code="bad-option") from None


async def reach(store: ObjectStore) -> None:
    """Raise BaseError or OSError if the store cannot be reached, or a folder not be written to."""
    if isinstance(store, LocalStore):
        if not os.access(str(store.prefix), os.R_OK | os.W_OK | os.X_OK):
            raise PermissionError("the folder is not there, or may not be written to")
        return
    with suppress(FileNotFoundError):
        await obstore.head_async(store, _REDIS_ID)


def job_folder(job_id: str) -> str:
    return f"jobs/{job_id}"


def image_path(job_id: str) -> str:
    return f"{job_folder(job_id)}/input/image"


def annotations_path(job_id: str) -> str:
    return f"{job_folder(job_id)}/input/annotations"


def attempt_folder(job_id: str, attempt: int) -> str:
    return f"{job_folder(job_id)}/attempt-{attempt}"


def round_folder(job_id: str, attempt: int, number: int) -> str:
    return f"{attempt_folder(job_id, attempt)}/round-{number}"


def part_path(job_id: str, attempt: int, number: int, part: int, kind: str) -> str:
    """Where the "request" or "result" of a part lies in a round of an attempt."""
    return f"{round_folder(job_id, attempt, number)}/{part}.{kind}"


def revision_folder(job_id: str, revision: int) -> str:
    return f"{job_folder(job_id)}/revisions/{revision}"


def manifest_path(job_id: str, revision: int = 0) -> str:
    return f"{revision_folder(job_id, revision) if revision else job_folder(job_id)}/manifest.json"


def derived_path(job_id: str, revision: int, name: str) -> str:
    return f"{revision_folder(job_id, revision)}/derived/{name}"


def read(store: ObjectStore, path: str) -> bytes:
    """The content at `path`. Raises FileNotFoundError where there is none."""
    return bytes(obstore.get(store, path).bytes())


def write(store: ObjectStore, path: str, data: bytes, media_type: str = _BYTES) -> StoredFile:
    """Store `data` at `path`, whole or not at all; in a bucket with its type, for direct downloads."""
    if isinstance(store, LocalStore):
        obstore.put(store, path, data)
    else:
        obstore.put(store, path, data, attributes={"Content-Type": media_type})
    return StoredFile(path, len(data), hashlib.sha256(data).hexdigest())


def write_once(store: ObjectStore, path: str, data: bytes) -> bool:
    """Store `data` at `path` unless something is there; whether nothing was."""
    try:
        obstore.put(store, path, data, mode="create")
    except AlreadyExistsError:
        return False
    return True


def delete(store: ObjectStore, path: str) -> None:
    """Delete the file at `path`; nothing there is fine."""
    with suppress(FileNotFoundError):
        obstore.delete(store, path)


def direct_link(store: ObjectStore, path: str, seconds: int) -> str | None:
    """An address in a bucket at which anyone can read the file for so long; None if it is in a folder."""
    return (
        obstore.sign(store, "GET", path, timedelta(seconds=seconds)) if isinstance(store, S3Store) else None
    )


def claim_for(store: ObjectStore, redis_id: str) -> str:
    """Which Redis the store belongs to: the one of this id, unless another has claimed it before."""
    try:
        obstore.put(store, _REDIS_ID, redis_id.encode(), mode="create")
    except AlreadyExistsError:
        return read(store, _REDIS_ID).decode().strip()
    return redis_id


def read_manifest(store: ObjectStore, job_id: str, revision: int = 0) -> Manifest | None:
    """The manifest of a job or of a revision of it, or None while there is none."""
    try:
        return Manifest.from_json(read(store, manifest_path(job_id, revision)))
    except FileNotFoundError:
        return None


def commit(store: ObjectStore, job_id: str, manifest: Manifest, revision: int = 0) -> bool:
    """Make a result visible, all at once; False if another attempt has done so before."""
    return write_once(store, manifest_path(job_id, revision), manifest.to_json())


def write_derived(
    store: ObjectStore, job_id: str, revision: int, name: str, data: bytes, media_type: str = _BYTES
) -> StoredFile:
    """Store a derived file and make it visible."""
    file = write(store, derived_path(job_id, revision, name), data, media_type)
    obstore.put(store, f"{file.path}.json", json.dumps(asdict(file)).encode())
    return file


def read_derived(store: ObjectStore, job_id: str, revision: int, name: str) -> StoredFile | None:
    """A derived file, or None while it has not been made."""
    try:
        fields = json.loads(read(store, f"{derived_path(job_id, revision, name)}.json"))
    except FileNotFoundError:
        return None
    return StoredFile(**known_fields(StoredFile, fields))


def delete_folder(store: ObjectStore, folder: str) -> None:
    """Delete everything under `folder`; nothing there is fine."""
    if isinstance(store, LocalStore):
        _delete_tree(Path(str(store.prefix)) / folder)
        return
    for page in obstore.list(store, prefix=folder, chunk_size=1000):
        obstore.delete(store, [entry["path"] for entry in page])


def _delete_tree(folder: Path) -> None:
    """Delete a folder and all that is in it.

    Also what the store does not list: `NAME#1`, which is left of a write that was broken off, and folders
    that hold nothing, as on a full disk, where a file's folder is made, and then not the file.
    """
    for place, _, names in os.walk(folder, topdown=False):
        for name in names:
            Path(place, name).unlink(missing_ok=True)
        with suppress(OSError):  # something has come into it
            os.rmdir(place)


def last_written(store: ObjectStore, folder: str) -> float:
    """When something in `folder` was last written, seconds since the epoch; 0 if nothing is there.

    So does what is being written, which is called `NAME#1` until it is whole, and which the store does not
    list.
    """
    if isinstance(store, LocalStore):
        return max(_times(Path(str(store.prefix)) / folder), default=0.0)
    pages = obstore.list(store, prefix=folder, chunk_size=1000)
    return max((entry["last_modified"].timestamp() for page in pages for entry in page), default=0.0)


def _times(folder: Path) -> Iterator[float]:
    """When each file under a folder was last written."""
    for place, _, names in os.walk(folder):
        for name in names:
            with suppress(FileNotFoundError):
                yield Path(place, name).stat().st_mtime
