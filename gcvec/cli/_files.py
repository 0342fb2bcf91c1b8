"""Files as the commands read and write them."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from gcvec.errors import InputError

if TYPE_CHECKING:
    from gcvec import VectorImage
    from gcvec.io import Picture


@contextmanager
def about(path: Path) -> Iterator[None]:
    """Name `path` in the message of an InputError raised inside."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}", code=error.code, pointer=error.pointer) from error


def load_picture(path: Path, matte: str) -> Picture:
    """The picture in a PNG, JPEG, WebP or TIFF file; its warnings go to stderr.

    Transparent pixels are laid over `matte`, written as #rrggbb. Raises InputError.
    """
    from gcvec.hex_color import rgb_from_hex
    from gcvec.io import read_picture

    color = rgb_from_hex(matte, "matte")
    with about(path):
        picture = read_picture(path.read_bytes(), matte=color)
    warn(path, picture.warnings)
    return picture


def load_vector_image(path: Path) -> VectorImage:
    """The vector image in a .gcv file. Raises InputError."""
    from gcvec import VectorImage

    with about(path):
        return VectorImage.from_bytes(path.read_bytes())


def require_folder(*paths: Path | None) -> None:
    """Refuse output files that no folder could hold, before the work and not after it. Raises InputError."""
    for path in paths:
        if path is not None and not path.absolute().parent.is_dir():
            raise InputError(f"{path}: no such folder: {path.parent}", code="no-folder")
        if path is not None and path.is_dir():
            raise InputError(f"{path}: is a folder", code="is-a-folder")


def write(path: Path, data: bytes) -> None:
    """Write a file whole or not at all. An OSError names the file, not what it is made of."""
    try:
        _write(path, data)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


def _write(path: Path, data: bytes) -> None:
    with tempfile.NamedTemporaryFile(
        dir=path.absolute().parent, prefix=f".{path.name}.", delete=False
    ) as file:
        try:
            file.write(data)
            file.close()
            os.chmod(file.name, 0o666 & ~_umask())
            os.replace(file.name, path)
        except BaseException:
            os.unlink(file.name)
            raise


def warn(path: Path, warnings: Iterable[str]) -> None:
    """Print one line a warning on stderr."""
    for warning in warnings:
        print(f"gcvec: warning: {path}: {warning}", file=sys.stderr)


def _umask() -> int:
    umask = os.umask(0)
    os.umask(umask)
    return umask
