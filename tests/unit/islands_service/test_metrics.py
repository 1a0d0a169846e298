"""Endpoint of the metrics of a coordinator."""

import socket
from pathlib import Path

import httpx
import pytest

from islands.errors import SettingsError
from islands_api.cli.commands.serve import roles
from islands_service.metrics import make_registry, serve_metrics
from islands_service.settings import ServiceSettings
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


def test_coordinators_of_one_service_have_different_ports(tmp_path: Path) -> None:
    def ports(**changes: int) -> list[str]:
        settings = ServiceSettings(data_dir=tmp_path, coordinators=2, **changes)
        commands = [role.command for role in roles(settings, 3, 4) if role.name.startswith("coordinator")]
        return [command[-1] for command in commands if "--metrics-port" in command]

    assert ports(metrics_port=9100) == ["9100", "9101"]
    assert ports() == []
