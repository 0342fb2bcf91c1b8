"""Files made of a finished vector image on demand."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from importlib import import_module

from obstore.store import ObjectStore

from gcvec import VectorImage
from gcvec.export.png import png
from worker import storage


def load_image(store: ObjectStore, path: str) -> VectorImage:
    """The vector image stored at `path`."""
    return _decoded(storage.read(store, path))


@lru_cache(maxsize=1)
def _decoded(data: bytes) -> VectorImage:
    """The last image is kept: whoever asks for one export often asks for the next."""
    return VectorImage.from_bytes(data)


def export(image: VectorImage, kind: str, scale: float) -> bytes:
    """The picture at `scale` for the kind "preview", else the file of one of `worker.artifacts.EXPORTS`."""
    if kind == "preview":
        return png(image.render(scale))
    writer: Callable[[VectorImage], bytes] = getattr(import_module(f"gcvec.export.{kind}"), kind)
    return writer(image)
