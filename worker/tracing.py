"""Traces of requests and tasks for an OpenTelemetry collector, where one is named.

With OTEL_EXPORTER_OTLP_ENDPOINT set and the packages of ``gcvec[otel]`` installed, FastAPI's own spans are
exported, and every task becomes a span of the trace that sent it. Otherwise nothing is loaded and nothing is
done. The other OTEL_... variables hold as they do everywhere.
"""

from __future__ import annotations

import logging
import os
from collections.abc import MutableMapping
from typing import Any, Final

from celery import signals

logger = logging.getLogger(__name__)

_ENDPOINTS: Final = ("OTEL_EXPORTER_OTLP_ENDPOINT", "OTEL_EXPORTER_OTLP_TRACES_ENDPOINT")


def start(service: str) -> bool:
    """Trace this process from now on under the name of `service`; False if that is not wanted or possible."""
    if not any(os.environ.get(name) for name in _ENDPOINTS):
        return False
    try:
        from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter
        from opentelemetry.sdk.resources import SERVICE_NAME, Resource
        from opentelemetry.sdk.trace import TracerProvider
        from opentelemetry.sdk.trace.export import BatchSpanProcessor
    except ImportError:
        logger.warning("traces are wanted, but the packages of gcvec[otel] are not installed")
        return False
    from opentelemetry import trace

    named = {SERVICE_NAME: os.environ.get("OTEL_SERVICE_NAME", service)}
    provider = TracerProvider(resource=Resource.create(named))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter()))
    trace.set_tracer_provider(provider)
    tracer = trace.get_tracer("gcvec")
    spans: dict[str, Any] = {}

    @signals.before_task_publish.connect(weak=False)
    def _send(headers: MutableMapping[str, Any], **_: Any) -> None:
        from opentelemetry.propagate import inject

        inject(headers)

    @signals.task_prerun.connect(weak=False)
    def _begin(task_id: str, task: Any, **_: Any) -> None:
        from opentelemetry.propagate import extract

        carrier = {name: task.request.get(name) or "" for name in ("traceparent", "tracestate")}
        span = tracer.start_as_current_span(task.name, extract(carrier), kind=trace.SpanKind.CONSUMER)
        span.__enter__()
        spans[task_id] = span

    @signals.task_postrun.connect(weak=False)
    def _end(task_id: str, **_: Any) -> None:
        spans.pop(task_id).__exit__(None, None, None)

    @signals.worker_process_shutdown.connect(weak=False)
    def _flush(**_: Any) -> None:
        provider.force_flush(2_000)

    return True
