"""Optional OpenTelemetry traces: one span per request and one per attempt at a job."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from islands.distribution import describe_missing_extra
from islands.errors import SettingsError


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
