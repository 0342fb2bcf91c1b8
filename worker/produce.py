"""From uploaded bytes to the bytes of every artefact: the one place where the service meets the engine."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from gcvec import Options, vectorize
from gcvec.errors import pointing_at
from gcvec.export import error_map, patch_overlay
from gcvec.export.png import png
from gcvec.io import check_size, matte_from, read_annotations, read_picture
from gcvec.metrics import Report, compare
from gcvec.progress import OnProgress
from worker.settings import Settings, limits


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
) -> Product:
    """Vectorize an uploaded picture. Raises gcvec.InputError, and whatever `on_progress` raises."""
    bounds = limits(settings)
    matte = matte_from(request.get("matte") or settings.matte)
    with pointing_at("/image"):
        picture = read_picture(image, limits=bounds, matte=matte)
    names = {name: request[name] for name in ("image_name", "picture_name")}
    options = Options(**request["options"])
    threads = min(options.workers or settings.job_threads, settings.job_threads)
    with pointing_at("/image" if annotations is None else "/annotations"):
        regions = None
        if annotations is not None:
            regions = read_annotations(annotations, **names, limits=bounds)
            height, width = picture.pixels.shape[:2]
            check_size(regions, width, height)
        result = vectorize(picture.pixels, regions, replace(options, workers=threads), on_progress)
    encoded = result.to_bytes()
    report = result.report or compare(picture.pixels, result, len(encoded))
    warnings = (*picture.warnings, *result.warnings)
    artifacts = {
        "gcv": encoded,
        "result": json.dumps({**result.description(), "warnings": warnings}).encode(),
        "report": json.dumps(report.as_dict()).encode(),
        "preview": png(result.render()),
        "error": png(error_map(picture.pixels, result)),
        "patches": png(patch_overlay(result)),
    }
    return Product(artifacts, warnings, _totals(report))


def _totals(report: Report) -> dict[str, float]:
    seconds = {f"seconds:{stage}": value for stage, value in report.seconds.items()}
    return {"points": report.points, **seconds}
