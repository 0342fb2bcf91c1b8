"""`/metrics`: figures of the whole service, kept in Redis, so every API process tells the same."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Final

from fastapi import APIRouter, Response
from prometheus_client import CollectorRegistry, generate_latest
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from service.deps import ServicesDep
from service.errors import documented
from service.jobs.repository import Figures

router = APIRouter(tags=["health"])

_MEDIA_TYPE: Final = "text/plain; version=0.0.4; charset=utf-8"


@router.get(
    "/metrics",
    summary="Figures for Prometheus",
    response_class=Response,
    responses={200: {"content": {"text/plain": {}}}, **documented(401, 403, 429, 503)},
)
async def metrics(services: ServicesDep) -> Response:
    """Queue lengths, jobs by state and end, failures by cause, seconds by stage."""
    registry = CollectorRegistry(auto_describe=False)
    registry.register(_Figures(await services.jobs.figures()))
    return Response(generate_latest(registry), media_type=_MEDIA_TYPE)


class _Figures(Collector):
    """The figures as Prometheus metrics."""

    def __init__(self, figures: Figures) -> None:
        self._figures = figures

    def collect(self) -> Iterable[Metric]:
        figures, totals = self._figures, self._figures.totals
        yield _gauges("gcvec_jobs", "Unfinished jobs", "status", figures.unfinished)
        yield _gauges("gcvec_queue_messages", "Messages that wait", "queue", figures.messages)
        age = 0.0 if figures.oldest_queued is None else max(0.0, time.time() - figures.oldest_queued)
        yield GaugeMetricFamily("gcvec_oldest_queued_seconds", "Age of the job that waits longest", age)
        foreign = GaugeMetricFamily("gcvec_store_foreign", "Whether the store belongs to another Redis")
        foreign.add_metric([], figures.foreign_store)
        yield foreign
        yield _counters("gcvec_jobs_finished", "Jobs by how they ended", "status", totals, "finished:")
        yield _counters("gcvec_jobs_failed", "Failed jobs by cause", "cause", totals, "failed:")
        yield _counters("gcvec_stage_seconds", "Engine time by stage", "stage", totals, "seconds:")
        yield CounterMetricFamily("gcvec_attempts", "Runs begun", totals.get("attempts", 0))
        yield CounterMetricFamily("gcvec_points", "Interior control points made", totals.get("points", 0))


def _gauges(name: str, text: str, label: str, values: Mapping[str, float]) -> Metric:
    family = GaugeMetricFamily(name, text, labels=[label])
    return _filled(family.add_metric, values, family)


def _counters(name: str, text: str, label: str, totals: Mapping[str, float], prefix: str) -> Metric:
    family = CounterMetricFamily(name, text, labels=[label])
    values = {key.removeprefix(prefix): value for key, value in totals.items() if key.startswith(prefix)}
    return _filled(family.add_metric, values, family)


def _filled(add: Callable[[list[str], float], None], values: Mapping[str, float], family: Metric) -> Metric:
    for key, value in sorted(values.items()):
        add([key], value)
    return family
