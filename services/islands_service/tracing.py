"""Traces for OpenTelemetry, where they are wanted: a span a request, and one an attempt at a job."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from islands.errors import SettingsError


class Traces:
    """Sends spans to a collector, or nowhere.

    Parameters
    ----------
    endpoint : str
        Of OTLP over HTTP, ``http://collector:4318/v1/traces``; "" for none.
    role : str
        Who sends.

    Raises
    ------
    SettingsError
        Traces are wanted, and their extra is not installed.
    """

    def __init__(self, endpoint: str, role: str) -> None:
        #: OpenTelemetry's provider of tracers; None where no traces are wanted.
        self.provider: Any = _provider(endpoint, role) if endpoint else None

    @contextmanager
    def span(self, name: str, **attributes: Any) -> Iterator[None]:
        """Trace what happens in the block."""
        if self.provider is None:
            yield
            return
        with self.provider.get_tracer("islands").start_as_current_span(name, attributes=attributes):
            yield

    def close(self) -> None:
        """Send what has not been sent yet."""
        if self.provider is not None:
            self.provider.shutdown()


def _provider(endpoint: str, role: str) -> Any:
    if find_spec("opentelemetry") is None or find_spec("opentelemetry.sdk") is None:
        raise SettingsError(
            "traces (ISLANDS_TELEMETRY) need an extra: install it with pip install 'islands[telemetry]'"
        )
    # Only who wants traces waits for these.
    from opentelemetry.exporter.otlp.proto.http.trace_exporter import OTLPSpanExporter  # noqa: PLC0415
    from opentelemetry.sdk.resources import Resource  # noqa: PLC0415
    from opentelemetry.sdk.trace import TracerProvider  # noqa: PLC0415
    from opentelemetry.sdk.trace.export import BatchSpanProcessor  # noqa: PLC0415

    provider = TracerProvider(resource=Resource.create({"service.name": f"islands-{role}"}))
    provider.add_span_processor(BatchSpanProcessor(OTLPSpanExporter(endpoint)))
    return provider
