"""Files in deploy/: each checker accepts them, and finds a planted fault."""

import json
import re
import shutil
import subprocess
import sysconfig
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml
from prometheus_client import generate_latest

from islands_service.coordinator.metrics import CoordinatorMetrics
from islands_service.domain.job import ProgressReport
from islands_service.settings import ServiceSettings
from support.repository import ROOT
from support.service import queued
from support.stores import claimed

pytestmark = pytest.mark.ci

DEPLOY = ROOT / "deploy"
ALERTS = DEPLOY / "monitoring/alerts.yml"
DASHBOARDS = sorted((DEPLOY / "monitoring/dashboards").glob("*.json"))
UNITS = sorted((DEPLOY / "systemd").glob("*.service"))

KUBERNETES = DEPLOY / "kubernetes/base"

#: Fields of a RayCluster, of its head group and of its worker groups that the manifest may use.
RAY_CLUSTER_FIELDS = {
    "cluster": {
        "authOptions",
        "autoscalerOptions",
        "enableInTreeAutoscaling",
        "headGroupSpec",
        "rayVersion",
        "suspend",
        "workerGroupSpecs",
    },
    "head": {"headService", "rayStartParams", "serviceType", "template"},
    "worker": {
        "groupName",
        "idleTimeoutSeconds",
        "maxReplicas",
        "minReplicas",
        "rayStartParams",
        "replicas",
        "template",
    },
}

#: Greatest exposure of a unit by `systemd-analyze security`, in tenths.
MAX_EXPOSURE = 30


def run(program: str, *arguments: object, cwd: Path | None = None) -> "subprocess.CompletedProcess[str]":
    """Run a program of the environment or of the system; skip the test if it is not installed."""
    found = shutil.which(program, path=sysconfig.get_path("scripts")) or shutil.which(program)
    if found is None:
        pytest.skip(f"needs {program}")
    return subprocess.run(
        [found, *map(str, arguments)], capture_output=True, text=True, timeout=120, cwd=cwd, check=False
    )


def accepted(done: "subprocess.CompletedProcess[str]") -> bool:
    """Return whether a checker accepted a file; print its output for the report of a failed test."""
    print(done.stdout, done.stderr)
    return done.returncode == 0


def planted(source: Path, folder: Path, change: Callable[[str], str]) -> Path:
    """Copy a file with a change of its text."""
    text = source.read_text()
    changed = change(text)
    assert changed != text
    copy = folder / source.name
    copy.write_text(changed)
    return copy


def test_the_containerfile_is_accepted_and_a_bad_practice_is_found(tmp_path):
    source = DEPLOY / "Containerfile"
    assert accepted(run("hadolint", source))
    fault = planted(
        source, tmp_path, lambda text: text.replace("USER 10001:10001", "USER root\nRUN cd /tmp && ls")
    )
    assert not accepted(run("hadolint", fault))


def test_the_compose_file_is_accepted_and_an_unknown_key_is_found(tmp_path):
    source = DEPLOY / "compose/compose.yaml"
    options = ("--builtin-schema", "vendor.compose-spec")
    assert accepted(run("check-jsonschema", *options, source))
    fault = planted(source, tmp_path, lambda text: text.replace("healthcheck:", "healthchecks:", 1))
    assert not accepted(run("check-jsonschema", *options, fault))


def test_the_settings_in_deployment_files_exist():
    known = {f"ISLANDS_{name.upper()}" for name in ServiceSettings.model_fields} | {
        "ISLANDS_CACHE_DIR",
        # Read by the deployment files themselves.
        "ISLANDS_SITE",
        "ISLANDS_HTTP_PORT",
        "ISLANDS_HTTPS_PORT",
        "ISLANDS_WORKER_CPUS",
        "ISLANDS_WORKER_MEMORY",
    }
    others = (".lock", ".json", ".pyc")
    files = [path for path in DEPLOY.rglob("*") if path.is_file() and path.suffix not in others]
    named = {name for path in files for name in re.findall(r"\bISLANDS_[A-Z_]+", path.read_text())}
    assert {"ISLANDS_RAY_ADDRESS", "ISLANDS_TRUSTED_PROXIES"} <= named
    assert named <= known


def manifests() -> list[Path]:
    configuration = ("kustomization.yaml", "name-references.yaml")
    return sorted(path for path in KUBERNETES.glob("*.yaml") if path.name not in configuration)


def pod_specs(document: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the specifications of the pods of an object."""
    spec = document.get("spec", {})
    groups = (
        [spec]
        + [spec[name] for name in ("headGroupSpec",) if name in spec]
        + spec.get("workerGroupSpecs", [])
    )
    return [group["template"]["spec"] for group in groups if "template" in group]


def test_all_manifests_belong_to_the_kustomization():
    listed = yaml.safe_load((KUBERNETES / "kustomization.yaml").read_text())["resources"]
    assert sorted(listed) == [path.name for path in manifests()]


def test_the_manifests_are_accepted_and_an_unknown_field_is_found(tmp_path):
    checked = [path for path in manifests() if path.stem != "ray-cluster"]
    assert accepted(run("kubernetes-validate", "--strict", *checked))
    fault = planted(
        KUBERNETES / "api.yaml", tmp_path, lambda text: text.replace("readinessProbe:", "readyProbe:")
    )
    assert not accepted(run("kubernetes-validate", "--strict", fault))


def test_the_ray_cluster_is_accepted_and_an_unknown_field_is_found(tmp_path):
    """Its own fields are those of KubeRay's reference; its pods are checked like any others."""
    document, _ = yaml.safe_load_all((KUBERNETES / "ray-cluster.yaml").read_text())

    def is_known(spec: dict[str, Any]) -> bool:
        groups = [("head", spec["headGroupSpec"])] + [("worker", group) for group in spec["workerGroupSpecs"]]
        return spec.keys() <= RAY_CLUSTER_FIELDS["cluster"] and all(
            group.keys() <= RAY_CLUSTER_FIELDS[kind] for kind, group in groups
        )

    assert is_known(document["spec"])
    assert not is_known({**document["spec"], "enableAutoscaling": True})
    packages = (ROOT / "requirements.lock").read_text()
    assert f"\nray=={document['spec']['rayVersion']} " in packages
    for number, spec in enumerate(pod_specs(document)):
        pod = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": f"ray-{number}"}, "spec": spec}
        path = tmp_path / f"{number}.yaml"
        path.write_text(yaml.safe_dump(pod))
        assert accepted(run("kubernetes-validate", "--strict", path))
        path.write_text(yaml.safe_dump(pod).replace("containers:", "container:", 1))
        assert not accepted(run("kubernetes-validate", "--strict", path))


def test_every_pod_meets_the_restricted_standard():
    """The namespace enforces it, so that a pod that does not would never start."""
    specs = [
        spec
        for path in manifests()
        for document in yaml.safe_load_all(path.read_text())
        for spec in pod_specs(document)
    ]
    assert len(specs) == 4
    for spec in specs:
        assert spec["securityContext"]["runAsNonRoot"]
        assert spec["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
        for container in spec["containers"]:
            confined = container["securityContext"]
            assert confined["readOnlyRootFilesystem"]
            assert not confined["allowPrivilegeEscalation"]
            assert confined["capabilities"] == {"drop": ["ALL"]}
            assert container["resources"]["limits"]["memory"]


def test_every_container_of_the_service_is_confined_in_the_compose_file():
    services = yaml.safe_load((DEPLOY / "compose/compose.yaml").read_text())["services"]
    ours = [service for service in services.values() if service["image"] == "islands"]
    assert len(ours) == 5
    for service in ours:
        assert service["read_only"]
        assert service["cap_drop"] == ["ALL"]
        assert service["security_opt"] == ["no-new-privileges:true"]


def test_api_and_coordinators_share_no_volume_but_the_object_store():
    """A file that only one machine has would be lost for the others."""
    services = yaml.safe_load((DEPLOY / "compose/compose.yaml").read_text())["services"]
    settings = yaml.safe_load((KUBERNETES / "config.yaml").read_text())["data"]
    for each in (services["api"]["environment"], services["coordinator"]["environment"], settings):
        assert ServiceSettings(blob_store=each["ISLANDS_BLOB_STORE"]).blobs.name == "blob-cache"
        assert each["AWS_SHARED_CREDENTIALS_FILE"].startswith("/run/secrets/")
        assert not {"AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"} & each.keys()
    for path in manifests():
        assert "persistentVolumeClaim" not in path.read_text()


def test_the_caddyfile_is_accepted_and_an_unknown_directive_is_found(tmp_path):
    source = DEPLOY / "compose/Caddyfile"
    options = ("--adapter", "caddyfile")
    assert accepted(run("caddy", "validate", "--config", source, *options))
    fault = planted(source, tmp_path, lambda text: text.replace("max_size", "max_sise"))
    assert not accepted(run("caddy", "validate", "--config", fault, *options))


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_a_unit_is_accepted_and_an_unknown_value_is_found(unit, tmp_path):
    def as_installed(text: str) -> str:
        # The program is not installed here, and its absence would be an error.
        return text.replace("/opt/islands/bin/islands", "/usr/bin/env").replace(
            "/opt/islands/bin/python", "/usr/bin/env"
        )

    good = planted(unit, tmp_path, as_installed)
    done = run("systemd-analyze", "verify", "--man=no", good)
    assert accepted(done)
    assert not done.stderr
    good.write_text(good.read_text().replace("Type=exec", "Type=execute"))
    assert "service type" in run("systemd-analyze", "verify", "--man=no", good).stderr


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_a_unit_is_confined_and_a_missing_confinement_is_found(unit, tmp_path):
    options = ("security", "--offline=yes", f"--threshold={MAX_EXPOSURE}", "--no-pager")
    assert accepted(run("systemd-analyze", *options, unit))
    loose = planted(
        unit,
        tmp_path,
        lambda text: re.sub(r"^(SystemCallFilter|CapabilityBoundingSet)=.*\n", "", text, flags=re.M),
    )
    assert not accepted(run("systemd-analyze", *options, loose))


def test_each_alert_fires_for_its_cause_only(tmp_path):
    assert accepted(run("promtool", "check", "rules", ALERTS))
    assert accepted(run("promtool", "test", "rules", "alerts.test.yml", cwd=ALERTS.parent))
    shutil.copy(ALERTS.with_name("alerts.test.yml"), tmp_path)
    planted(ALERTS, tmp_path, lambda text: text.replace("islands_leases) == 0", "islands_leases) == 1"))
    assert not accepted(run("promtool", "test", "rules", "alerts.test.yml", cwd=tmp_path))


def test_the_configuration_of_prometheus_is_accepted_and_a_fault_is_found(tmp_path):
    source = DEPLOY / "compose/prometheus.yml"
    assert accepted(run("promtool", "check", "config", "--syntax-only", source))
    fault = planted(source, tmp_path, lambda text: text.replace("scrape_interval", "scrape_every"))
    assert not accepted(run("promtool", "check", "config", "--syntax-only", fault))


def expressions(document: Any) -> list[str]:
    """Return the queries of a dashboard."""
    return [target["expr"] for panel in document["panels"] for target in panel["targets"]]


def metric_names(text: str) -> set[str]:
    """Return the names of the metrics of queries in PromQL."""
    return set(re.findall(r"\b(?:islands|process)_[a-z_]+\b", text))


def test_every_query_names_existing_metrics(serve):
    """A renamed metric would leave an alert silent for ever."""
    with serve() as service:
        queued(service.store)
        queued(service.store)
        lease = claimed(service.store)
        progress = {"evaluations_per_second": 1.0, "best_error": 0.1, "generation": 1}
        service.store.leases.report(lease, ProgressReport(progress))
        service.client.get("/v1/jobs")
        offered = httpx.get(f"{service.url}/metrics", trust_env=False).text
    coordinator = CoordinatorMetrics()
    coordinator.finished.labels("identification", "succeeded").inc()
    coordinator.given_back.labels("stopping").inc()
    coordinator.observe_object("put", "done", 0.1)
    offered += generate_latest(coordinator.registry).decode()
    existing = {re.split(r"[ {]", line)[0] for line in offered.splitlines() if not line.startswith("#")}
    queries = "\n".join(
        [*re.findall(r"expr:(.*?)(?=\n\s+for:)", ALERTS.read_text(), re.DOTALL)]
        + [each for path in DASHBOARDS for each in expressions(json.loads(path.read_text()))]
    )
    named = metric_names(queries)
    assert len(named) > 15
    assert named <= existing
    assert not metric_names("rate(islands_requests_total[5m])") <= existing
