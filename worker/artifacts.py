"""The files a finished job offers, by name."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class Kind:
    """A kind of artefact: its file name, its media type and the last part of its address."""

    filename: str
    media_type: str
    route: str


KINDS: Final[dict[str, Kind]] = {
    "result": Kind("result.json", "application/json", "result"),
    "gcv": Kind("result.gcv", "application/vnd.gcvec", "result.gcv"),
    "preview": Kind("preview.png", "image/png", "preview.png"),
    "error": Kind("error.png", "image/png", "error.png"),
    "patches": Kind("patches.png", "image/png", "patches.png"),
    "report": Kind("report.json", "application/json", "report"),
}
"""Written by the job itself."""

REVISED: Final = ("result", "gcv", "preview", "patches")
"""Those that a revision has too; what compares with the photo it has not."""

EXPORTS: Final[dict[str, Kind]] = {
    "svg": Kind("result.svg", "image/svg+xml", "result.svg"),
    "pdf": Kind("result.pdf", "application/pdf", "result.pdf"),
    "glb": Kind("result.glb", "model/gltf-binary", "result.glb"),
}
"""Made when they are first asked for: `gcvec.export.NAME` holds a function NAME from image to bytes."""
