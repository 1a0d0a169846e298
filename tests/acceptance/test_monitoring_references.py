"""Names in the files of Prometheus and Grafana lead to files, services, ports, secrets and sources."""

import json
import re
from collections.abc import Iterator
from pathlib import Path, PurePosixPath
from typing import Any

import pytest
import yaml

from islands_service.settings import ServiceSettings
from support.repository import ROOT

pytestmark = pytest.mark.ci

COMPOSE = ROOT / "deploy/compose"


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text())


def find_source(service: dict[str, Any], path: str) -> Path | None:
    """Return the file of the repository that a container has at a path; None if it has none there."""
    for volume in service["volumes"]:
        source, target = volume.split(":")[:2]
        if source.startswith(".") and PurePosixPath(path).is_relative_to(target):
            return (COMPOSE / source / PurePosixPath(path).relative_to(target)).resolve()
    return None


def read_monitoring() -> dict[str, Any]:
    """Return the documents of the monitoring by name; sources and dashboards are those that Grafana finds."""
    services = read(COMPOSE / "compose.yaml")["services"]

    def provisioned(kind: str) -> Iterator[dict[str, Any]]:
        for path in sorted(
            find_source(services["grafana"], f"/etc/grafana/provisioning/{kind}").glob("*.yml")
        ):
            yield from read(path)["providers" if kind == "dashboards" else kind]

    folders = [
        find_source(services["grafana"], each["options"]["path"]) for each in provisioned("dashboards")
    ]
    return {
        "services": services,
        "prometheus": read(COMPOSE / "prometheus.yml"),
        "alerts": read(ROOT / "deploy/monitoring/alerts.yml"),
        "sources": list(provisioned("datasources")),
        "dashboards": [
            json.loads(path.read_text()) for folder in folders for path in sorted(folder.glob("*.json"))
        ],
    }


def find_wrong_scrapes(given: dict[str, Any]) -> Iterator[str]:
    """Prometheus has its files and secrets, and scrapes the ports at which the roles serve their metrics."""
    services, prometheus = given["services"], given["prometheus"]
    for name in ("prometheus.yml", *prometheus["rule_files"]):
        source = find_source(services["prometheus"], f"/etc/prometheus/{name}")
        if source is None or not source.is_file():
            yield f"file {name}"
    metrics = services["coordinator"]["environment"]["ISLANDS_METRICS_PORT"]
    ports = {"api": ServiceSettings().port, "coordinator": int(metrics)}
    for job in prometheus["scrape_configs"]:
        secret = job.get("authorization", {}).get("credentials_file", "").removeprefix("/run/secrets/")
        if secret and secret not in services["prometheus"]["secrets"]:
            yield f"secret {secret}"
        for each in job["dns_sd_configs"]:
            yield from (f"port of {name}" for name in each["names"] if ports.get(name) != each["port"])


def find_wrong_dashboards(given: dict[str, Any]) -> Iterator[str]:
    """Grafana has dashboards, whose panels query a source that exists and jobs that are scraped."""
    if not given["dashboards"]:
        yield "dashboards"
    for source in given["sources"]:
        # The standard port of Prometheus, which no command of its service changes.
        if source["url"] != "http://prometheus:9090" or "command" in given["services"]["prometheus"]:
            yield f"address {source['url']}"
    sources = {(each["type"], each["uid"]) for each in given["sources"]}
    for panel in (panel for dashboard in given["dashboards"] for panel in dashboard["panels"]):
        named = [
            panel["datasource"],
            *(each.get("datasource", panel["datasource"]) for each in panel["targets"]),
        ]
        if not {(each["type"], each["uid"]) for each in named} <= sources:
            yield f"source of {panel['title']}"
    jobs = [each["job_name"] for each in given["prometheus"]["scrape_configs"]]
    queries = json.dumps([given["dashboards"], given["alerts"]]).replace("\\", "")
    for pattern in set(re.findall(r'\bjob=~?"([^"]+)"', queries)):
        if not any(re.fullmatch(pattern, job) for job in jobs):
            yield f"job {pattern}"


def test_every_name_in_the_monitoring_leads_somewhere():
    given = read_monitoring()
    assert not [*find_wrong_scrapes(given), *find_wrong_dashboards(given)]
