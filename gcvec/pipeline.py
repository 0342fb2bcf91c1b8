"""Photo and regions → vector image: the stages in the order of the paper's Fig. 4."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from gcvec.annotations import Annotations, check_size
from gcvec.borders.border import borders
from gcvec.borders.localize import LARGEST_SHIFT, localized
from gcvec.borders.planar_graph import planar_graph
from gcvec.colors.boundary_color import color_samples, fit_boundary_colors, hard_edges
from gcvec.curves.network_fit import fitted_network
from gcvec.metrics import Report, compare
from gcvec.options import Options
from gcvec.parallel import use_workers
from gcvec.parts.crew import Crew, refine_by
from gcvec.patches.canonical import lay_unfolded_foundation
from gcvec.photo import require_photo
from gcvec.progress import OnProgress, Progress
from gcvec.quantization import Quantization
from gcvec.refinement.batch import refine_batch
from gcvec.refinement.scene import Scene, Terms
from gcvec.refinement.state import Step
from gcvec.refinement.to_bytes import refine_to_bytes
from gcvec.regions.partition import Partition, partition
from gcvec.regions.segment import CLEAR_STEP, FAINT_STEP, segment
from gcvec.regions.snap import snap_borders
from gcvec.timing import StageClock
from gcvec.vector_image import VectorImage

FULL = 0.95
"""A region with this share of the points it may have is taken as full: a few find no place."""

BYTES_A_REGION = 350
"""No more automatic regions than this leaves room for in a file of a given size: three times what each
takes."""

BEFORE_RUNS, AFTER_RUNS = 0.1, 0.95
"""Shares of the work that are done when refinement begins and when it ends."""

ROUNDING = 0.1
"""The paper's refinement looks at colours as they are before they are rounded to the file's steps, which adds
at most this share of the target."""


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
    start = time.perf_counter()
    use_workers(options.workers)
    clock = StageClock()
    height, width = pixels.shape[:2]
    if annotations is not None:
        check_size(annotations, width, height)
    picture = pixels / 255.0
    tell = _Teller(on_progress)

    tell.stage("regions", 0.01)
    with clock.stage("regions"):
        regions = _regions(pixels, picture, annotations, options)
    tell.regions = len(regions.names)
    tell.stage("boundary", 0.05)
    with clock.stage("boundary"):
        found = borders(planar_graph(regions.labels), width, height)
        network = fitted_network(*localized(found, picture, _reach(annotations, options)))
        samples = color_samples(network)
        hard = hard_edges(network, samples, picture, regions.labels)
    tell.stage("mesh", BEFORE_RUNS)
    with clock.stage("mesh_harmonic"):
        foundation = lay_unfolded_foundation(network, hard)
    with clock.stage("boundary"):
        boundary_colors = fit_boundary_colors(
            foundation.network, foundation.space, hard, samples, picture, regions.labels
        )
    del picture  # large
    scene = Scene(pixels, foundation, boundary_colors, regions.names)

    iterations: dict[bytes, Counter[int]] = {}

    def refined(target_mse: float) -> tuple[bytes, VectorImage]:
        tell.run(target_mse, last=not options.target_bytes)
        steps = Quantization.for_error(target_mse)
        terms = Terms(target_mse, steps, options.max_points, options.effort)
        if options.strategy == "paper":
            from gcvec.refinement.paper import refine_paper  # with the sparse solvers, which are slow to load

            found = refine_paper(scene, terms, tell.iteration, clock)
        else:
            start = None
            if crew is not None and len(foundation.network.loops) > 1:
                with clock.stage("parts"):
                    start = refine_by(crew, scene, terms, tell.iteration)
            found = refine_batch(scene, terms, tell.iteration, clock, start)
        iterations[found[0]] = tell.iterations
        return found

    if options.target_bytes:
        data, image = refine_to_bytes(refined, options.target_bytes)
    else:
        data, image = refined(options.target_mse)
    with clock.stage("evaluation"):
        report = compare(pixels, image, len(data))
    seconds = {**clock.seconds, "total": time.perf_counter() - start}
    patches = tuple(replace(r, iterations=iterations[data][r.id]) for r in report.regions)
    report = replace(report, strategy=options.strategy, seconds=seconds, regions=patches)
    result = replace(image, warnings=(*regions.warnings, *_shortfall(report, options)), report=report)
    tell.done(report.points, report.mse)
    return result.knowing(image.canvas, data, image.picture)


def _regions(
    pixels: NDArray[np.uint8], picture: NDArray[np.float64], annotations: Annotations | None, options: Options
) -> Partition:
    if annotations is None:
        # Where regions are bounded, more of them hold more control points.
        as_many_as_pay = not options.regions and not options.max_points
        found = segment(pixels, options.regions, CLEAR_STEP if as_many_as_pay else FAINT_STEP)
        affordable = max(options.target_bytes // BYTES_A_REGION, 1)
        if options.target_bytes and not options.regions and len(found.names) > affordable:
            found = segment(pixels, affordable)
        return found
    height, width = pixels.shape[:2]
    regions = partition(annotations, width, height)
    return replace(regions, labels=snap_borders(regions.labels, picture, options.snap))


def _reach(annotations: Annotations | None, options: Options) -> float:
    """How far borders may move from the label map's onto the picture's steps, pixels."""
    return LARGEST_SHIFT if annotations is None else min(options.snap, LARGEST_SHIFT)


def _shortfall(report: Report, options: Options) -> tuple[str, ...]:
    """In one line, by how much the picture misses its target and why; nothing where it does not."""
    mse = report.mse_raw if options.strategy == "paper" else report.mse
    if mse <= options.target_mse or options.target_bytes:
        return ()
    bound = options.max_points
    full = [r for r in report.regions if bound and r.points >= FULL * bound and r.mse > options.target_mse]
    if full:
        why = (
            f"{len(full)} of {report.patches} regions hold the {bound} control points that max_points allows"
        )
    elif options.strategy == "paper" and mse <= (1 + ROUNDING) * options.target_mse:
        why = "rounding to the file's steps has cost the rest"
    else:
        why = "more control points no longer help"
    return (f"the mean squared error stays at {mse:.2f}, above the target of {options.target_mse:g}: {why}",)


class _Teller:
    """Progress reports whose fraction never falls; counts the iterations in which each region grew."""

    def __init__(self, on_progress: OnProgress | None) -> None:
        self.on_progress = on_progress
        self.regions = 0
        self.fraction = 0.0
        self.iterations: Counter[int] = Counter()

    def _tell(
        self, phase: str, region: int, iteration: int, points: int, worst: float | None, mse: float | None
    ) -> None:
        if self.on_progress:
            self.on_progress(
                Progress(phase, region, self.regions, iteration, points, worst, mse, self.fraction)
            )

    def run(self, target_mse: float, last: bool) -> None:
        """A run of refinement begins. While none is known to be the last, each gets half of what is left."""
        self.target_mse = target_mse
        self.first_mse: float | None = None
        self.iterations = Counter()
        self._before = max(self.fraction, BEFORE_RUNS)
        self._share = (AFTER_RUNS - self._before) * (1 if last else 0.5)

    def stage(self, phase: str, fraction: float) -> None:
        self.fraction = max(self.fraction, fraction)
        self._tell(phase, 0, 0, 0, None, None)

    def iteration(self, step: Step) -> None:
        """Progress through refinement is measured by the logarithm of the error still to go."""
        self.iterations.update(step.grown)
        self.first_mse = self.first_mse or max(step.mse, self.target_mse * 1.001)
        gone = np.log(self.first_mse / max(step.mse, self.target_mse)) / np.log(
            self.first_mse / self.target_mse
        )
        self.fraction = max(self.fraction, self._before + self._share * float(np.clip(gone, 0, 1)))
        self._tell("refine", step.worst_region, step.iteration, step.points, step.worst_error, step.mse)

    def done(self, points: int, mse: float) -> None:
        self.fraction = 1.0
        self._tell("encode", 0, 0, points, None, mse)
