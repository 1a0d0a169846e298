"""Metrics of the processes and their endpoint, and traces."""

import socket
from http.server import BaseHTTPRequestHandler, HTTPServer
from threading import Thread

import httpx
import pytest
from opentelemetry.proto.collector.trace.v1.trace_service_pb2 import ExportTraceServiceRequest

from islands.errors import SettingsError
from islands_service.telemetry import Traces, make_registry, serve_metrics
from support.service import served
from support.service_processes import free_port


def test_a_coordinator_offers_its_metrics_without_a_key() -> None:
    port = free_port()
    serve_metrics(make_registry("coordinator"), "127.0.0.1", port)
    text = httpx.get(f"http://127.0.0.1:{port}/metrics", trust_env=False).text
    assert 'role="coordinator"' in text
    assert "process_cpu_seconds_total" in text


def test_a_port_in_use_is_refused() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(SettingsError, match=rf"port {port} .*set ISLANDS_METRICS_HOST"):
            serve_metrics(make_registry("coordinator"), "127.0.0.1", port)


@pytest.fixture
def collector():
    """A collector of OTLP over HTTP: its address, and the received bodies."""
    received = []

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            received.append(self.rfile.read(int(self.headers["Content-Length"])))
            self.send_response(200)
            self.end_headers()

        def log_message(self, *_):
            pass

    server = HTTPServer(("127.0.0.1", 0), Handler)
    thread = Thread(target=server.serve_forever)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}/v1/traces", received
    server.shutdown()
    thread.join()
    server.server_close()


def spans(received):
    """Yield the service name and the name of every span."""
    for body in received:
        for resource in ExportTraceServiceRequest.FromString(body).resource_spans:
            sender = {each.key: each.value.string_value for each in resource.resource.attributes}
            for scope in resource.scope_spans:
                for span in scope.spans:
                    yield sender["service.name"], span.name


@pytest.mark.ci
def test_requests_are_spans_except_health_checks(collector, tmp_path):
    address, received = collector
    with served(tmp_path / "data", telemetry=address) as service:
        assert service.client.get("/v1/jobs").status_code == 200
        assert service.client.get("/readyz").status_code == 200
    sent = list(spans(received))
    assert ("islands-api", "GET /v1/jobs") in sent
    assert not any("readyz" in name for _, name in sent)


def test_an_attempt_at_a_job_is_a_span_of_the_coordinator(collector):
    address, received = collector
    traces = Traces(address, "coordinator")
    with traces.span("identification", job="1f", attempt=2):
        pass
    traces.close()
    assert list(spans(received)) == [("islands-coordinator", "identification")]


def test_traces_without_an_endpoint_create_no_provider():
    traces = Traces("", "coordinator")
    with traces.span("identification"):
        traces.close()
    assert traces.provider is None
