"""Endpoint of the metrics of a coordinator."""

import socket

import httpx
import pytest

from islands.errors import SettingsError
from islands_service.metrics import make_registry, serve_metrics
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
