"""Names in the files of Compose lead to services, secrets, networks and volumes that are defined."""

from pathlib import Path
from typing import Any

import yaml

from support.repository import ROOT

COMPOSE = ROOT / "deploy/compose"


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text())


def test_every_name_in_the_compose_file_is_defined():
    document = read(COMPOSE / "compose.yaml")
    for name, service in document["services"].items():
        assert set(service["networks"]) <= document["networks"].keys(), name
        assert set(service.get("depends_on", ())) <= document["services"].keys(), name
        assert set(service.get("secrets", ())) <= document["secrets"].keys(), name
        for volume in service.get("volumes", ()):
            source = volume.split(":")[0]
            assert (COMPOSE / source).exists() if source.startswith(".") else source in document["volumes"]
        for value in service.get("environment", {}).values():
            if value.startswith("/run/secrets/"):
                assert value.removeprefix("/run/secrets/") in service["secrets"], name


def test_every_host_in_the_files_of_compose_shares_a_network_with_its_clients():
    services = read(COMPOSE / "compose.yaml")["services"]
    scraped = read(COMPOSE / "prometheus.yml")["scrape_configs"]
    calls = [("prometheus", each["names"][0]) for job in scraped for each in job["dns_sd_configs"]]
    calls += [("grafana", "prometheus"), ("caddy", "api"), ("api", "storage"), ("coordinator", "storage")]
    calls += [(role, host) for role in ("coordinator", "api") for host in ("postgres", "ray-head")]
    assert "reverse_proxy api:8000" in (COMPOSE / "Caddyfile").read_text()
    for client, host in calls:
        assert set(services[client]["networks"]) & set(services[host]["networks"]), (client, host)


def test_the_guide_of_compose_creates_every_secret():
    guide = (ROOT / "docs/how-to/deploy-with-compose.md").read_text()
    for secret in read(COMPOSE / "compose.yaml")["secrets"].values():
        assert secret["file"] in guide
