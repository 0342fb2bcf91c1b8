"""From uploaded bytes to the bytes of every artefact."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields, replace
from typing import Any, Final

from gcvec import Options, vectorize
from gcvec.errors import InputError, pointing_at
from gcvec.export import error_map, patch_overlay
from gcvec.export.png import png
from gcvec.hex_color import rgb_from_hex
from gcvec.io import Picture, read_annotations, read_picture
from gcvec.metrics import Report, compare
from gcvec.options import without_effect
from gcvec.parts.crew import Crew
from gcvec.progress import OnProgress
from worker.settings import Settings, limits

_OPTION_NAMES: Final = frozenset(option.name for option in fields(Options))
_UNUSED_NAME: Final = "image_name is not used: it picks an image in annotations, and none were sent"


@dataclass(frozen=True)
class Product:
    """What a run delivers: artefacts by name, the warnings of every stage, what it adds to the totals."""

    artifacts: dict[str, bytes]
    warnings: tuple[str, ...]
    totals: dict[str, float]


def produce(
    image: bytes,
    annotations: bytes | None,
    request: Mapping[str, Any],
    settings: Settings,
    on_progress: OnProgress,
    crew: Crew | None = None,
) -> Product:
    """Vectorize an uploaded picture, with the help of a crew if it is large.

    Raises gcvec.InputError, and whatever `on_progress` and the crew raise.
    """
    bounds = limits(settings)
    picture = read_photo(image, request, settings)
    names = {name: request[name] for name in ("image_name", "picture_name")}
    options = replace(Options(**request["options"]), workers=threads(request, settings))
    n_pixels = picture.pixels.shape[0] * picture.pixels.shape[1]
    large = 0 < settings.fan_out_megapixels < n_pixels / 1e6
    with _pointing_at_options(), pointing_at("/image" if annotations is None else "/annotations"):
        regions = None if annotations is None else read_annotations(annotations, **names, limits=bounds)
        result = vectorize(picture.pixels, regions, options, on_progress, crew if large else None)
    encoded = result.to_bytes()
    report = result.report or compare(picture.pixels, result, len(encoded))
    warnings = (*_ignored(request, options, annotations is not None), *picture.warnings, *result.warnings)
    artifacts = {
        "gcv": encoded,
        "result": json.dumps({**result.description(), "warnings": warnings}).encode(),
        "report": json.dumps({**report.as_dict(), "warnings": warnings}).encode(),
        "preview": png(result.picture),
        "error": png(error_map(picture.pixels, result)),
        "patches": png(patch_overlay(result)),
    }
    return Product(artifacts, warnings, _totals(report))


def _ignored(request: Mapping[str, Any], options: Options, annotated: bool) -> list[str]:
    """What was asked for and has no effect, one line each; an option's default is not told from none."""
    unused = [_UNUSED_NAME] if not annotated and request["image_name"] is not None else []
    wanted = asdict(options)
    ignored = without_effect(wanted, annotated)
    return unused + [line for name, line in ignored.items() if wanted[name] != getattr(Options, name)]


@contextmanager
def _pointing_at_options() -> Iterator[None]:
    """Let an error about one of the engine's options point at it in the request."""
    try:
        yield
    except InputError as error:
        if error.pointer not in _OPTION_NAMES:
            raise
        raise InputError(str(error), code=error.code, pointer=f"/options/{error.pointer}") from error


def read_photo(image: bytes, request: Mapping[str, Any], settings: Settings) -> Picture:
    """An uploaded picture. Raises gcvec.InputError."""
    matte = rgb_from_hex(request.get("matte") or settings.matte, "matte")
    with pointing_at("/image"):
        return read_picture(image, limits=limits(settings), matte=matte)


def threads(request: Mapping[str, Any], settings: Settings) -> int:
    """How many threads a job gets."""
    wanted: int = request["options"].get("workers", 0)
    return min(wanted or settings.job_threads, settings.job_threads)


def _totals(report: Report) -> dict[str, float]:
    """What the service counts of a job: its points, and the time of each stage, not of all together."""
    seconds = {f"seconds:{stage}": value for stage, value in report.seconds.items() if stage != "total"}
    return {"points": report.points, **seconds}
