"""A trace joins a request to its job and to what the job makes; without an endpoint there is none."""

import subprocess
import sys
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread

import pytest
from sqlalchemy import select

from store import tracing
from store.tables import Job
from tests.support.campaigns import upload_campaign
from tests.support.compose import ROOT
from tests.support.ports import pick_port

TRACE, CALLER = "0af7651916cd43dd8448eb211c80319c", "b7ad6b7169203331"


@contextmanager
def receiving():
    """A collector's endpoint: its address, and the spans that arrive at it."""
    from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import (  # noqa: PLC0415
        ExportTraceServiceRequest,
    )

    spans = []

    class Collector(BaseHTTPRequestHandler):
        def do_POST(self):
            body = self.rfile.read(int(self.headers["Content-Length"]))
            for resource in ExportTraceServiceRequest.FromString(body).resource_spans:
                spans.extend(span for scope in resource.scope_spans for span in scope.spans)
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Collector) as server:
        Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}", spans
        server.shutdown()


@pytest.fixture
def traced(monkeypatch):
    """`traced(endpoint)` traces this process; `traced.flush()` sends what there is."""

    def begin(endpoint):
        monkeypatch.setenv("OTEL_EXPORTER_OTLP_ENDPOINT", endpoint)
        monkeypatch.setenv("OTEL_EXPORTER_OTLP_COMPRESSION", "none")
        tracing.configure_tracing("test")
        return tracing._tracers[0].span_processor

    yield begin
    for tracer in tracing._tracers:
        tracer.span_processor.shutdown()
    tracing._tracers.clear()


@pytest.mark.either_database
def test_one_trace_leads_from_the_request_over_the_job_to_the_version(house, staged, traced):
    campaign = staged(upload_campaign, isos=(3200,))
    house.work()
    with receiving() as (endpoint, spans):
        sender = traced(endpoint)
        path = f"/v1/campaigns/{campaign['id']}/calibrations"
        asked = house.http.post(path, json={}, headers={"traceparent": f"00-{TRACE}-{CALLER}-01"})
        house.http.get("/livez")
        with house.database.reading() as session:
            kept = session.scalar(select(Job.traceparent).where(Job.id == asked.json()["id"]))
        house.work()
        sender.force_flush()
    made = house.get(f"/v1/jobs/{asked.json()['id']}")["result"]["calibration_id"]
    found = {span.name: span for span in spans}
    request, job = found["POST /v1/campaigns/{campaign_id}/calibrations"], found["job fit"]
    assert kept == f"00-{TRACE}-{request.span_id.hex()}-01"
    assert request.parent_span_id.hex() == CALLER
    assert job.parent_span_id == request.span_id
    assert {request.trace_id.hex(), job.trace_id.hex()} == {TRACE}
    told = {each.key: each.value.string_value for each in job.attributes}
    assert (told["stilb.job_id"], told["stilb.calibration_id"]) == (asked.json()["id"], made)
    assert not [name for name in found if "livez" in name]


def test_an_endpoint_that_is_away_stops_nothing(traced, monkeypatch):
    monkeypatch.setattr(tracing, "_EXPORT_WITHIN_S", 0.1)
    traced(f"http://127.0.0.1:{pick_port()}")
    for _ in range(3000):  # more than its queue holds
        with tracing.span("job fit", kind="CONSUMER", parent=None, known={"job_id": "j"}) as note:
            note({"state": "failed"}, failed=True)
            assert tracing.present_traceparent()


# FastAPI itself imports the API of OpenTelemetry, which does nothing
@pytest.mark.parametrize(
    ("part", "kept_out"), [("worker.process", "opentelemetry"), ("service.__main__", "opentelemetry.sdk")]
)
def test_without_an_endpoint_nothing_is_imported(part, kept_out):
    code = (
        f"import sys, {part}\n"
        "from store import tracing\n"
        "tracing.configure_tracing('test')\n"
        "with tracing.span('job', kind='CONSUMER', parent=None, known={}) as note: note({})\n"
        "assert tracing.present_traceparent() is None\n"
        f"sys.exit(any(name.startswith('{kept_out}') for name in sys.modules))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, cwd=ROOT, env={}).returncode == 0
