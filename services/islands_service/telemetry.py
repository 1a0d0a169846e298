"""Metrics and traces of the processes."""

import platform
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from prometheus_client import CollectorRegistry, Histogram, Info, ProcessCollector, start_http_server

from islands.distribution import describe_missing_extra, read_version
from islands.errors import SettingsError

#: Upper bounds in seconds of the buckets of durable writes.
WRITE_BUCKETS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 5.0)


def make_registry(role: str) -> CollectorRegistry:
    """Return a registry with the metrics of this process.

    Parameters
    ----------
    role : str
        ``api`` or ``coordinator``, a label of ``islands_build_info``.
    """
    registry = CollectorRegistry()
    ProcessCollector(registry=registry)
    build = Info("islands_build", "Version of islands and of Python.", registry=registry)
    build.info({"version": read_version(), "python": platform.python_version(), "role": role})
    return registry


def make_commit_histogram(registry: CollectorRegistry) -> Histogram:
    """Return the metric of the transactions of this process, for `Database.observe_commit`."""
    return Histogram(
        "islands_store_commit_seconds",
        "Time of a transaction of the store, which may contain several operations.",
        buckets=WRITE_BUCKETS,
        registry=registry,
    )


def make_object_observer(registry: CollectorRegistry) -> Callable[[str, str, float], None]:
    """Return a function that counts the operations of an object store, for `Blobs.observe_object`."""
    seconds = Histogram(
        "islands_object_store_seconds",
        "Time of a request to the object store, by operation and outcome: done, missing, refused, "
        "unavailable, failed.",
        ["operation", "outcome"],
        buckets=(*WRITE_BUCKETS, 30.0),
        registry=registry,
    )
    return lambda operation, outcome, took: seconds.labels(operation, outcome).observe(took)


def serve_metrics(registry: CollectorRegistry, host: str, port: int) -> None:
    """Serve the metrics of a process without a web interface from a background thread, at ``/metrics``.

    Raises
    ------
    SettingsError
        The address does not belong to this machine, or another program uses the port.
    """
    try:
        start_http_server(port, host, registry)
    except OSError as error:
        raise SettingsError(
            f"cannot serve metrics at {host}, port {port} ({error.strerror}): set ISLANDS_METRICS_HOST and "
            "ISLANDS_METRICS_PORT to a free port of this machine"
        ) from error


class Traces:
    """Exporter of spans; does nothing without an endpoint.

    Parameters
    ----------
    endpoint : str
        URL of a collector that accepts OTLP over HTTP, ``http://collector:4318/v1/traces``; empty to disable.
    role : str
        Process that sends, part of the service name.

    Raises
    ------
    SettingsError
        An endpoint is given, but the extra ``telemetry`` is not installed.
    """

    def __init__(self, endpoint: str, role: str) -> None:
        #: Tracer provider of OpenTelemetry; None without an endpoint.
        self.provider: Any = _provider(endpoint, role) if endpoint else None

    @contextmanager
    def span(self, name: str, **attributes: Any) -> Iterator[None]:
        """Record the block as a span."""
        if self.provider is None:
            yield
            return
        with self.provider.get_tracer("islands").start_as_current_span(name, attributes=attributes):
            yield

    def close(self) -> None:
        """Send the remaining spans."""
        if self.provider is not None:
            self.provider.shutdown()


def _provider(endpoint: str, role: str) -> Any:
    if find_spec("opentelemetry") is None or find_spec("opentelemetry.sdk") is None:
        raise SettingsError(describe_missing_extra("the setting ISLANDS_TELEMETRY", "telemetry"))
    # These imports are slow, and only needed with an endpoint.
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter  # noqa: PLC0415
    from opentelemetry.sdk.resources import Resource  # noqa: PLC0415
    from opentelemetry.sdk.trace import TracerProvider  # noqa: PLC0415
    from opentelemetry.sdk.trace.export import BatchSpanProcessor  # noqa: PLC0415

    provider = TracerProvider(resource=Resource.create({"service.name": f"islands-{role}"}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter(endpoint)))
    return provider
