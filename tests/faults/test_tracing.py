"""One trace from a submission to the end of its job, as a collector gets it."""

from __future__ import annotations

import gzip
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from importlib import import_module
from typing import Any

import pytest

from tests.fleet import SHORT, Fleet
from tests.readers import missing
from tests.servers import in_background
from tests.waiting import within
from worker import tracing

pytestmark = [pytest.mark.service, pytest.mark.slow]


class Collector(ThreadingHTTPServer):
    """Takes spans by OTLP over HTTP: (service, name, trace id) of each."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.spans: list[tuple[str, str, bytes]] = []


class _Handler(BaseHTTPRequestHandler):
    server: Collector

    def do_POST(self) -> None:
        from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

        body = self.rfile.read(int(self.headers["content-length"]))
        body = gzip.decompress(body) if self.headers.get("content-encoding") == "gzip" else body
        for group in ExportTraceServiceRequest.FromString(body).resource_spans:
            names = {entry.key: entry.value.string_value for entry in group.resource.attributes}
            for scope in group.scope_spans:
                found = [(names["service.name"], span.name, span.trace_id) for span in scope.spans]
                self.server.spans.extend(found)
        self.send_response(200)
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def collector() -> Iterator[Collector]:
    try:
        import_module("opentelemetry.exporter.otlp.proto.http")
    except ImportError:
        missing("gcvec[otel] is not installed")
    server = Collector()
    with in_background(server):
        yield server


def test_a_job_is_part_of_the_trace_that_submitted_it(
    start_fleet: Callable[..., Fleet], collector: Collector
) -> None:
    endpoint = f"http://127.0.0.1:{collector.server_port}"
    fleet = start_fleet(OTEL_EXPORTER_OTLP_ENDPOINT=endpoint, OTEL_BSP_SCHEDULE_DELAY="200")
    api = fleet.start_api()
    fleet.start_worker()
    ids = [api.submit(24, number, **SHORT) for number in range(2)]
    for job_id in ids:
        assert api.outcome(job_id)["status"] == "succeeded"

    def traces(service: str, name: str) -> list[bytes]:
        return [trace for known, found, trace in collector.spans if (known, found) == (service, name)]

    within(20, lambda: len(traces("gcvec-worker", "gcvec.vectorize")) == 2)
    within(20, lambda: len(traces("gcvec-api", "POST /v1/jobs")) == 2)
    ran = traces("gcvec-worker", "gcvec.vectorize")
    assert len(set(ran)) == 2
    assert set(ran) == set(traces("gcvec-api", "POST /v1/jobs"))


def test_nothing_is_traced_unless_a_collector_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OTEL_EXPORTER_OTLP_ENDPOINT", raising=False)
    monkeypatch.delenv("OTEL_EXPORTER_OTLP_TRACES_ENDPOINT", raising=False)
    assert not tracing.start("gcvec-api")
