"""Files as the commands read and write them."""

from __future__ import annotations

import errno
import os
import stat
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gcvec.cli._limits import limits
from gcvec.errors import InputError

if TYPE_CHECKING:
    from gcvec import VectorImage
    from gcvec.io import Picture

STANDARD_STREAM = Path("-")
"""Stands for stdin among inputs and for stdout among outputs."""

SHOWN = 32
"""Characters of a file's name that are in the name of the one that is to replace it."""


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Name `path` in the message of an InputError raised inside."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}", code=error.code, pointer=error.pointer) from error


def read(path: Path) -> bytes:
    """What a file holds, or stdin for `STANDARD_STREAM`."""
    if path != STANDARD_STREAM:
        return path.read_bytes()
    if sys.stdin is None:
        raise OSError(errno.EBADF, "stdin is closed", str(path))
    return sys.stdin.buffer.read()


def load_picture(path: Path, matte: str) -> Picture:
    """The picture in a PNG, JPEG, WebP or TIFF file; its warnings go to stderr.

    Transparent pixels are laid over `matte`, written as #rrggbb. Raises InputError.
    """
    from gcvec.hex_color import rgb_from_hex
    from gcvec.io import read_picture
    from gcvec.photo import require_photo

    color, bounds = rgb_from_hex(matte, "matte"), limits()
    with about(path):
        picture = read_picture(read(path), limits=bounds, matte=color)
        require_photo(picture.pixels)
    warn(path, picture.warnings)
    return picture


def load_vector_image(data: bytes, path: Path) -> VectorImage:
    """The vector image that a .gcv file holds. Raises InputError."""
    from gcvec import VectorImage

    with about(path):
        return VectorImage.from_bytes(data)


def vector_image_file(output: str, source: Path) -> Path:
    """The file that `output` names; if it ends in a slash, one named like `source` in that folder, which is
    made if it is missing.

    Raises `InputError` where something else is in the folder's place, or `source` has no name.
    """
    if not output.endswith(os.sep):
        return Path(output)
    if source == STANDARD_STREAM:
        raise InputError(f"{output}: what stdin holds has no name; name the file", code="is-a-folder")
    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError(f"{output}: no folder: a file stands there", code="no-folder") from error
    return folder / f"{source.stem}.gcv"


def check_files(*, inputs: Sequence[Path | None] = (), outputs: Sequence[Path | None] = ()) -> None:
    """Refuse output files, before the work and not after it.

    Raises `InputError` for those that no folder could hold, for links that lead nowhere but back, and for
    one that is an input or another output; PermissionError for those that may not be written.
    """
    for paths, stream in ((inputs, "stdin is read"), (outputs, "stdout is written")):
        if paths.count(STANDARD_STREAM) > 1:
            raise InputError(f"{STANDARD_STREAM}: {stream} for one file only", code="same-file")
    taken = [path for path in inputs if path and path != STANDARD_STREAM]
    for path in outputs:
        if path is None or path == STANDARD_STREAM:
            continue
        if _leads_back(path):
            raise InputError(f"{path}: a link that leads back to itself", code="link-loop")
        folder = path.resolve().parent
        if not folder.is_dir():
            raise InputError(f"{path}: no such folder: {folder}", code="no-folder")
        if path.is_dir():
            raise InputError(f"{path}: is a folder", code="is-a-folder")
        if any(_is_same(path, other) for other in taken):
            raise InputError(f"{path}: would be written over another file of this command", code="same-file")
        if not _may_be_written(path):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))
        taken.append(path)


def write(path: Path, data: bytes) -> None:
    """Write a file, whole or not at all where it can be replaced; or stdout for `STANDARD_STREAM`.

    An OSError names the file, not what it is made of.
    """
    try:
        if path == STANDARD_STREAM:
            _write_to_stdout(data)
        else:
            _write(path, data)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _write_to_stdout(data: bytes) -> None:
    if sys.stdout is None:
        raise OSError(errno.EBADF, "stdout is closed")
    # Through no buffer of Python's own, which would be written again, and fail again, when the process ends.
    with open(sys.stdout.fileno(), "wb", closefd=False) as stream:
        stream.write(data)


def _write(path: Path, data: bytes) -> None:
    if _is_special(path):
        path.write_bytes(data)
        return
    target = path.resolve()  # what a link leads to is replaced, not the link
    try:
        _replace(target, data)
    except PermissionError:
        if not target.exists():
            raise
        target.write_bytes(data)  # its folder is closed to us; the file itself may be open


def _replace(path: Path, data: bytes) -> None:
    prefix = f".{path.name[:SHOWN]}."  # not all of it: a name that is as long as can be leaves no room
    with tempfile.NamedTemporaryFile(dir=path.parent, prefix=prefix, delete=False) as file:
        try:
            file.write(data)
            file.close()
            os.chmod(file.name, _mode(path))
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def _is_special(path: Path) -> bool:
    """Whether this is a device or a pipe: one writes into it, and must never put a file in its place."""
    return path.exists() and not path.is_file()


def _leads_back(path: Path) -> bool:
    """Whether following links from here, or to here, never ends."""
    try:
        path.stat()
    except OSError as error:
        return error.errno == errno.ELOOP
    return False


def _is_same(path: Path, other: Path) -> bool:
    """Whether two paths lead to the same file, there or yet to be written."""
    if path.exists() and other.exists():
        return path.samefile(other) and not _is_special(path)
    return path.resolve() == other.resolve()


def _may_be_written(path: Path) -> bool:
    """Whether a file may be written itself, or be replaced by another in its folder."""
    folder_will_do = not _is_special(path) and os.access(path.resolve().parent, os.W_OK)
    return folder_will_do or os.access(path, os.W_OK)


def warn(path: Path, warnings: Iterable[str]) -> None:
    """Print one line a warning on stderr."""
    for warning in warnings:
        print(f"gcvec: warning: {path}: {warning}", file=sys.stderr)


def _mode(path: Path) -> int:
    """Who may read and write a file: as before where it is there already."""
    if path.exists():
        return stat.S_IMODE(path.stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask
