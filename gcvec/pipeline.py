"""Photo and regions → vector image: the stages in the order of the paper's Fig. 4."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gcvec.annotations import Annotations, check_size
from gcvec.automatic_regions import automatic_regions, needed_points
from gcvec.borders.border import sample_borders
from gcvec.borders.localize import LARGEST_SHIFT, localized
from gcvec.borders.planar_graph import planar_graph
from gcvec.colors.boundary_color import color_samples, fit_boundary_colors, hard_edges
from gcvec.curves.network_fit import fitted_network
from gcvec.errors import InputError
from gcvec.metrics import Report, compare
from gcvec.options import Options
from gcvec.parallel import workers
from gcvec.parts.crew import Crew, refine_by
from gcvec.patches.canonical import lay_unfolded_foundation
from gcvec.photo import require_photo
from gcvec.progress import BEFORE_RUNS, OnProgress, Teller
from gcvec.refinement.batch import exchanges, refine_batch
from gcvec.refinement.scene import Scene, Terms
from gcvec.refinement.to_bytes import CLOSE, USUAL_MSE, likely_mse, refine_to_bytes
from gcvec.regions.partition import Partition, partition
from gcvec.regions.snap import snap_borders
from gcvec.timing import StageClock
from gcvec.vector_image import VectorImage

FULL = 0.95
"""A region with this share of the points it may have is taken as full: a few find no place."""

FEWER = 2 / 3
"""A picture whose automatic regions do not fit into a file is divided anew, into this share of them."""


def vectorize(
    pixels: NDArray[np.uint8],
    annotations: Annotations | None = None,
    options: Options | None = None,
    on_progress: OnProgress | None = None,
    crew: Crew | None = None,
) -> VectorImage:
    """Vectorize a photo `(h, w, 3) uint8`.

    Without annotations the regions are found automatically. `on_progress` hears of every stage and every
    refinement iteration; an exception it raises ends the run. A `crew` refines the picture in parts, if it
    has several regions and the strategy is "batch". Raises `InputError` for pixels or regions that cannot be
    used.
    """
    require_photo(pixels)
    options = options or Options()
    if annotations is not None:
        check_size(annotations, pixels.shape[1], pixels.shape[0])
    pixels = np.ascontiguousarray(pixels)  # kernels are compiled anew for any other layout
    with workers(options.workers):
        return _vectorized(pixels, annotations, options, on_progress, crew)


def _vectorized(
    pixels: NDArray[np.uint8],
    annotations: Annotations | None,
    options: Options,
    on_progress: OnProgress | None,
    crew: Crew | None,
) -> VectorImage:
    begin = time.perf_counter()
    clock, tell = StageClock(), Teller(on_progress)

    tell.stage("regions", 0.01)
    with clock.stage("regions"):
        regions = _regions(pixels, annotations, options)
    may_be_fewer = annotations is None and not options.regions and options.target_bytes > 0
    while True:
        try:
            found = _drawn(pixels, regions, _reach(annotations, options), options, crew, clock, tell)
            break
        except InputError as error:
            # Before a picture is divided, what its borders will take is but an estimate.
            fewer = int(len(regions.names) * FEWER)
            if error.pointer != "target_bytes" or not may_be_fewer or not fewer:
                raise
        with clock.stage("regions"):
            regions = automatic_regions(pixels, replace(options, regions=fewer))
    with clock.stage("evaluation"):
        report = compare(pixels, found.image, len(found.data))
    report = replace(
        report,
        strategy=options.strategy,
        seconds={**clock.seconds, "total": time.perf_counter() - begin},
        regions=tuple(replace(r, iterations=found.iterations[r.id]) for r in report.regions),
    )
    tell.done(report.points, report.mse)
    shortfall = _shortfall(report, options, found)
    image = replace(found.image, region_warnings=regions.warnings, result_warnings=shortfall, report=report)
    return image.knowing(found.image.canvas, found.data, found.image.picture)


def _drawn(
    pixels: NDArray[np.uint8],
    regions: Partition,
    reach: float,
    options: Options,
    crew: Crew | None,
    clock: StageClock,
    tell: Teller,
) -> _Outcome:
    """The picture of these regions that the options ask for.

    Raises `InputError` where there is none that fits into the bytes wanted.
    """
    tell.regions = len(regions.names)
    scene = _scene(pixels, regions, reach, clock, tell)

    def run(target_mse: float) -> _Outcome:
        return _refined(scene, replace(options, target_mse=target_mse), crew, clock, tell)

    if not options.target_bytes:
        return run(options.target_mse)
    need = needed_points(pixels, USUAL_MSE)
    first_mse = likely_mse(float(need.sum()), options.target_bytes)
    return refine_to_bytes(run, options.target_bytes, first_mse)


def _regions(pixels: NDArray[np.uint8], annotations: Annotations | None, options: Options) -> Partition:
    """The regions drawn, their borders snapped to the picture's edges; without annotations, those found."""
    if annotations is None:
        return automatic_regions(pixels, options)
    height, width = pixels.shape[:2]
    regions = partition(annotations, width, height)
    return replace(regions, labels=snap_borders(regions.labels, pixels / 255.0, options.snap))


def _reach(annotations: Annotations | None, options: Options) -> float:
    """How far borders may move from the label map's onto the picture's steps, pixels."""
    return LARGEST_SHIFT if annotations is None else min(options.snap, LARGEST_SHIFT)


def _scene(
    pixels: NDArray[np.uint8], regions: Partition, reach: float, clock: StageClock, tell: Teller
) -> Scene:
    """Regions → curves, domains, S and the first boundary colours; borders move by `reach` pixels at most."""
    height, width = pixels.shape[:2]
    picture = pixels / 255.0
    tell.stage("boundary", 0.05)
    with clock.stage("boundary"):
        traced = sample_borders(planar_graph(regions.labels), width, height)
        network = fitted_network(*localized(traced, regions.labels, picture, reach))
        samples = color_samples(network)
        hard = hard_edges(network, samples, picture, regions.labels)
    tell.stage("mesh", BEFORE_RUNS)
    with clock.stage("mesh_harmonic"):
        foundation = lay_unfolded_foundation(network, hard)
    with clock.stage("boundary"):
        boundary_colors = fit_boundary_colors(
            foundation.network, foundation.space, hard, samples, picture, regions.labels
        )
    return Scene(pixels, foundation, boundary_colors, regions.names)


class _Outcome(NamedTuple):
    """The outcome of a run of refinement: see `Draft`; in how many iterations each region grew, and the error
    that the last of them had come to, before colours were rounded."""

    data: bytes
    image: VectorImage
    mse: float
    tried: NDArray[np.int64]
    iterations: Counter[int]
    refined_mse: float | None


def _refined(scene: Scene, options: Options, crew: Crew | None, clock: StageClock, tell: Teller) -> _Outcome:
    """A scene refined to the target error of the options."""
    batch = options.strategy == "batch"
    axes = 1 if _is_gray(scene.pixels) else 3
    terms = Terms(options.target_mse, options.max_points, options.effort, axes)
    tell.run(
        terms.target_mse,
        exchanges=batch and bool(exchanges(terms.effort, 0)),
        last=not options.target_bytes,
    )
    if batch:
        start = None
        if crew is not None and len(scene.foundation.network.loops) > 1:
            with clock.stage("parts"):
                start = refine_by(crew, scene, terms, tell.iteration)
        draft = refine_batch(scene, terms, tell.iteration, clock, start)
    else:
        from gcvec.refinement.paper import refine_paper  # with the sparse solvers, which are slow to load

        draft = refine_paper(scene, terms, tell.iteration, clock)
    return _Outcome(draft.data, draft.image, draft.mse, draft.tried, tell.iterations, tell.mse)


def _is_gray(pixels: NDArray[np.uint8]) -> bool:
    """Whether all colours `(h, w, 3)` are grey."""
    return bool((pixels == pixels[..., :1]).all())


def _shortfall(report: Report, options: Options, found: _Outcome) -> tuple[str, ...]:
    """In one line, by how much the picture misses its target and why; nothing where it does not.

    The paper's strategy ends by colours that are not rounded yet; it needs no iteration where those at first
    are good enough.
    """
    alone = options.strategy == "paper"  # each region then stops by its own error, else by the picture's
    mse = report.mse_raw if alone else report.mse
    wanted = mse if options.target_bytes else options.target_mse
    bound = options.max_points
    enough = wanted if alone else 0.0
    tried = found.tried
    full = sum(bool(bound) and tried[r.id] >= FULL * bound and r.mse > enough for r in report.regions)
    held_back = (
        f"{full} of {report.patches} regions need more than the {bound} control points that max_points allows"
    )
    if options.target_bytes:
        if not full or report.bytes >= CLOSE * options.target_bytes:
            return ()
        return (f"the file takes {report.bytes} of {options.target_bytes} bytes, no more: {held_back}",)
    if mse <= wanted:
        return ()
    if full:
        why = held_back
    elif alone and (found.refined_mse is None or found.refined_mse <= wanted):
        why = "rounding to the file's steps has cost the rest"
    else:
        why = "more control points no longer help"
    which = "mean squared error at the centres of pixels" if alone else "mean squared error"
    return (f"the {which} stays at {mse:.2f}, above the target of {wanted:g}: {why}",)
