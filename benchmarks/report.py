"""Measures and tells: the tables of docs/benchmarks.md."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from typing import Any

from benchmarks import codecs, delaunay_gouraud, tracing
from benchmarks.command import whole_command
from benchmarks.editing import edits
from benchmarks.engine import vectorized
from benchmarks.growth import exponent, grown
from benchmarks.machine import description
from benchmarks.plan import Plan
from benchmarks.run import Outcome, Run
from gcvec.timing import STAGES

CONDITIONS = """\
Photos are those of scikit-image, resampled to {size:g} megapixels unless said otherwise, with
automatic regions and no bound on control points. Errors are mean squared errors on the 0-255 scale.
Every measurement is a process of its own, on a machine that may have had other work too; the
engine's kernels are loaded before the clock starts."""

GROWTH = """\
Fitted exponents: time {time}, memory above the idle engine's {memory}. The photo is resampled, so a
larger one holds no finer detail."""

SIZES = """\
Each column holds the smallest file within the target, in kilobytes; one that misses it stands in
brackets with its error. vtracer is tried with {tried} settings. Delaunay-Gouraud is a plain greedy
mesh (`benchmarks/delaunay_gouraud.py`), measured at pixel centres, whose bytes are an estimate: the
entropy of its rounded positions and colours."""

COMMANDS = """\
The median of three runs, with all that the process takes to start."""

EFFORTS = """\
More effort exchanges more control points for better ones."""

EDITS = """\
Nothing is fitted or solved again. Moves include the search for fold-overs. Medians of five runs."""

PAPER = """\
The paper's strategy adds one point at a time and brings each region within its target by itself, at pixel
centres. The default one is given the error of its picture as the target. Both errors are those of the
anti-aliased picture."""

LEAST_MEMORY = 1e6
"""Bytes beyond those of an idle engine: fewer vanish in what it has freed itself."""


def document(plan: Plan, run: Run) -> str:
    """Measure all that the plan asks for; the page that tells of it."""
    results = {
        (name, target): run.measure(vectorized, name=name, megapixels=plan.size, target_mse=target)
        for name in plan.pictures
        for target in plan.targets
    }
    commands = _commands(plan, run)
    sizes, efforts = _sizes(plan, run, results), _efforts(plan, run)
    strategies, edited = _strategies(plan, run), _edits(plan, run)
    growth = _growth(plan, run)  # last, for it may use up the run's time
    sections = (
        ["# Benchmarks", f"Written by `make bench` on {datetime.now(UTC):%Y-%m-%d}."],
        ["Machine: " + "; ".join(description()) + "."],
        [CONDITIONS.format(size=plan.size)],
        _stages(plan, results),
        commands,
        efforts,
        growth,
        sizes,
        strategies,
        edited,
    )
    return "\n\n".join(part for section in sections for part in section) + "\n"


def _stages(plan: Plan, results: dict[tuple[str, float], Outcome]) -> list[str]:
    rows = []
    for name in plan.pictures:
        outcome = results[name, plan.timed_target]
        if outcome.failure:
            rows.append([name, outcome.failure])
            continue
        report = outcome.value
        seconds = [f"{report['seconds'][stage]:.2f}" for stage in STAGES]
        rate = report["points"] / report["seconds"]["total"]
        rows.append([name, f"{report['points']:,}", *seconds, f"{rate:,.0f}", _megabytes(outcome.peak)])
    heading = [
        "picture",
        "points",
        *(f"{stage}, s" for stage in STAGES),
        "points a second",
        "peak, MB",
    ]
    return [f"## Seconds by stage, at an error of {plan.timed_target:g}", _table(heading, rows)]


def _commands(plan: Plan, run: Run) -> list[str]:
    rows = []
    for size, name in [(plan.tiny_size, plan.pictures[0]), *((plan.size, name) for name in plan.pictures)]:
        asked = {"name": name, "megapixels": size, "target_mse": plan.timed_target}
        outcome = run.measure(whole_command, **asked)
        found = outcome.value
        figures = (
            [outcome.failure] if found is None else [f"{found['seconds']:.2f}", _megabytes(found["peak"])]
        )
        rows.append([name, f"{size:g}", *figures])
    heading = ["picture", "megapixels", "seconds", "peak, MB"]
    return [
        f"## `gcvec vectorize` from start to end, at an error of {plan.timed_target:g}",
        COMMANDS,
        _table(heading, rows),
    ]


def _growth(plan: Plan, run: Run) -> list[str]:
    name = plan.pictures[0]
    measured = grown(run, name, plan.growth_sizes, plan.growth_target)
    rows = []
    for size, outcome in measured:
        if outcome.failure:
            rows.append([f"{size:g}", outcome.failure])
            continue
        report = outcome.value
        memory = [_megabytes(outcome.peak), _megabytes(outcome.peak - report["base"])]
        seconds = f"{report['seconds']['total']:.1f}"
        rows.append([f"{size:g}", f"{report['points']:,}", seconds, *memory])
    whole = [(size, outcome) for size, outcome in measured if not outcome.failure]
    sizes = [size for size, _ in whole]
    time = exponent(sizes, [outcome.value["seconds"]["total"] for _, outcome in whole])
    more = [outcome.peak - outcome.value["base"] for _, outcome in whole]
    space = exponent(sizes, more, LEAST_MEMORY)
    heading = ["megapixels", "points", "seconds", "peak memory, MB", "of it above the idle engine's, MB"]
    return [
        f"## Growth: {name} at an error of {plan.growth_target:g}",
        _table(heading, rows),
        GROWTH.format(time=_exponent(time), memory=_exponent(space)),
    ]


def _sizes(plan: Plan, run: Run, results: dict[tuple[str, float], Outcome]) -> list[str]:
    heading = ["picture", "target", "gcvec, points", "gcvec"]
    heading += [*codecs.CODECS, "vtracer, gzip", "Delaunay-Gouraud, points", "Delaunay-Gouraud"]
    rows = []
    for name in plan.pictures:
        common = {"name": name, "megapixels": plan.size, "targets": plan.targets}
        columns = [run.measure(codecs.sizes, codec=codec, **common) for codec in codecs.CODECS]
        columns.append(run.measure(tracing.sizes, **common))
        mesh = run.measure(delaunay_gouraud.sizes, **common)
        for number, target in enumerate(plan.targets):
            own = results[name, target]
            others = [_kilobytes(column, number, target) for column in columns]
            gcvec = [_points(own.value), _kilobytes(own, None, target)]
            plain = [_points(_entry(mesh, number)), _kilobytes(mesh, number, target)]
            rows.append([name, f"{target:g}", *gcvec, *others, *plain])
    return [
        "## Points and kilobytes at the same error",
        _table(heading, rows),
        SIZES.format(tried=len(tracing.SETTINGS)),
    ]


def _efforts(plan: Plan, run: Run) -> list[str]:
    rows = []
    for name in plan.pictures:
        for effort in plan.efforts:
            common = {"name": name, "megapixels": plan.size, "target_mse": plan.timed_target}
            outcome = run.measure(vectorized, effort=effort, **common)
            if outcome.failure:
                rows.append([name, str(effort), outcome.failure])
                continue
            report = outcome.value
            seconds, points = report["seconds"]["total"], report["points"]
            kilobytes = _kilobytes(outcome, None, plan.timed_target)
            figures = [f"{points:,}", kilobytes, f"{seconds:.2f}", f"{points / seconds:,.0f}"]
            rows.append([name, str(effort), *figures])
    heading = ["picture", "effort", "points", "kilobytes", "seconds", "points a second"]
    return [f"## Efforts, at an error of {plan.timed_target:g}", _table(heading, rows), EFFORTS]


def _strategies(plan: Plan, run: Run) -> list[str]:
    rows = []
    for name in plan.pictures:
        common = {"name": name, "megapixels": plan.paper_size, "regions": plan.paper_regions}
        paper = run.measure(vectorized, strategy="paper", target_mse=plan.paper_target, **common)
        if paper.failure:
            rows.append([name, paper.failure])
            continue
        batch = run.measure(vectorized, target_mse=paper.value["mse"], **common)
        if batch.failure:
            rows.append([name, batch.failure])
            continue
        slow, fast = paper.value, batch.value
        times = [report["seconds"]["total"] for report in (slow, fast)]
        points = [report["points"] for report in (slow, fast)]
        errors = [f"{report['mse']:.1f}" for report in (slow, fast)]
        rows.append(
            [
                name,
                *errors,
                *(f"{count:,}" for count in points),
                f"{100 * points[1] / max(points[0], 1):.0f} %",
                *(f"{seconds:.2f}" for seconds in times),
                f"{times[0] / times[1]:.0f}",
            ]
        )
    heading = ["picture", "error, paper", "error", "points, paper", "points", "share"]
    heading += ["seconds, paper", "seconds", "times as fast"]
    size = f"{1e6 * plan.paper_size:,.0f} pixels in {plan.paper_regions} regions"
    return [f"## The paper's strategy, {size}", _table(heading, rows), PAPER]


def _edits(plan: Plan, run: Run) -> list[str]:
    rows = []
    for name in plan.pictures:
        outcome = run.measure(edits, name=name, megapixels=plan.size, target_mse=plan.timed_target)
        figures = (
            [outcome.failure] if outcome.failure else [f"{1000 * s:.1f}" for s in outcome.value.values()]
        )
        rows.append([name, *figures])
    heading = ["picture", "move, ms", "recolour, ms", "move and draw, ms"]
    return [f"## Edits, at an error of {plan.timed_target:g}", EDITS, _table(heading, rows)]


def _entry(outcome: Outcome, number: int | None) -> Any:
    if outcome.failure:
        return None
    return outcome.value if number is None else outcome.value[number]


def _points(entry: Any) -> str:
    return "" if entry is None else f"{entry['points']:,}"


def _kilobytes(outcome: Outcome, number: int | None, target: float) -> str:
    entry = _entry(outcome, number)
    if entry is None:
        return outcome.failure
    shown = f"{entry['bytes'] / 1000:.1f}"
    return shown if entry["mse"] <= target else f"({shown}: {entry['mse']:.1f})"


def _megabytes(count: int) -> str:
    return f"{count / 1e6:,.0f}"


def _exponent(value: float | None) -> str:
    return "unknown" if value is None else f"{value:.2f}"


def _table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; rows that are too short end in empty cells."""
    lines = [heading, ["---"] * len(heading), *([*row, *[""] * (len(heading) - len(row))] for row in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)
