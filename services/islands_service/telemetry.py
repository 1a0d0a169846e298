"""Traces for OpenTelemetry, where they are wanted: a span a request, and one an attempt at a job."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

from islands.errors import SettingsError


def configure_traces(endpoint: str, role: str) -> Any:
    """Send traces to a collector; return where spans are made.

    Parameters
    ----------
    endpoint : str
        Of OTLP over HTTP, ``http://collector:4318/v1/traces``; "" sends none.

    Raises
    ------
    SettingsError
        The extra is not installed.
    """
    if not endpoint:
        return None
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


@contextmanager
def span(provider: Any, name: str, **attributes: Any) -> Iterator[None]:
    """Trace what happens in the block, if traces are wanted."""
    if provider is None:
        yield
        return
    with provider.get_tracer("islands").start_as_current_span(name, attributes=attributes):
        yield
