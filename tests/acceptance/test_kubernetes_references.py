"""References between the objects of Kubernetes lead to objects that are deployed."""

import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from support.repository import ROOT

KUBERNETES = ROOT / "deploy/kubernetes/base"

#: Substitute for the hash that kustomize appends to the name of a generated object.
HASH = "-hash"

#: Field of a kustomization that generates objects of a kind.
GENERATORS = {"Secret": "secretGenerator", "ConfigMap": "configMapGenerator"}

#: Fields of a pod template that refer to an object of a kind. Kustomize rewrites them in the kinds of
#: Kubernetes, and in custom resources only if the kustomization configures it.
POD_FIELDS = {
    "Secret": (
        "volumes/secret/secretName",
        "containers/env/valueFrom/secretKeyRef/name",
        "containers/envFrom/secretRef/name",
    ),
    "ConfigMap": (
        "volumes/configMap/name",
        "containers/env/valueFrom/configMapKeyRef/name",
        "containers/envFrom/configMapRef/name",
    ),
}


def read(path: Path) -> Any:
    return yaml.safe_load(path.read_text())


def holders(node: Any, path: list[str]) -> Iterator[dict[str, Any]]:
    """Yield the mappings that have the last field of a path; a path passes through lists."""
    if isinstance(node, list):
        for each in node:
            yield from holders(each, path)
    elif isinstance(node, dict) and path[0] in node:
        if len(path) == 1:
            yield node
        else:
            yield from holders(node[path[0]], path[1:])


def rewritten_fields(document: dict[str, Any], kind: str, configured: list[Any]) -> list[str]:
    """Return the fields of an object in which kustomize rewrites the names of objects of a kind."""
    if document["apiVersion"] in ("v1", "apps/v1", "batch/v1"):
        return [f"spec/template/spec/{field}" for field in POD_FIELDS[kind]]
    group = document["apiVersion"].partition("/")[0]
    return [
        field["path"]
        for entry in configured
        if entry["kind"] == kind
        for field in entry["fieldSpecs"]
        if field["kind"] == document["kind"] and field.get("group", group) == group
    ]


def render(folder: Path) -> list[dict[str, Any]]:
    """Return the objects of a kustomization with the names that kustomize gives them."""
    kustomization = read(folder / "kustomization.yaml")
    objects = [
        document
        for name in kustomization["resources"]
        for document in yaml.safe_load_all((folder / name).read_text())
    ]
    configured = [
        entry
        for name in kustomization.get("configurations", [])
        for entry in read(folder / name)["nameReference"]
    ]
    for kind, generator in GENERATORS.items():
        entries = kustomization.get(generator, [])
        names = {entry["name"] for entry in entries}
        for document in objects:
            for path in rewritten_fields(document, kind, configured):
                *_, last = path.split("/")
                for holder in holders(document, path.split("/")):
                    if holder[last] in names:
                        holder[last] += HASH
        objects += [
            {
                "apiVersion": "v1",
                "kind": kind,
                "metadata": {"name": entry["name"] + HASH},
                "data": {file.partition("=")[0]: file for file in entry["files"]},
            }
            for entry in entries
        ]
    return objects


def pod_templates(objects: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the pod templates of Deployments and RayClusters."""
    paths = ("spec/template", "spec/headGroupSpec/template", "spec/workerGroupSpecs/template")
    return [
        holder["template"]
        for document in objects
        for path in paths
        for holder in holders(document, path.split("/"))
    ]


def provided(objects: list[dict[str, Any]]) -> dict[tuple[str, str], set[str]]:
    """Return the keys of each Secret and ConfigMap; KubeRay creates the secret of a cluster with tokens."""
    found = {
        (each["kind"], each["metadata"]["name"]): set(each["data"])
        for each in objects
        if each["kind"] in GENERATORS
    }
    for each in objects:
        if each["kind"] == "RayCluster" and each["spec"].get("authOptions") == {"mode": "token"}:
            found["Secret", each["metadata"]["name"]] = {"auth_token"}
    return found


def missing_objects(objects: list[dict[str, Any]]) -> list[str]:
    """Return the references of pods to Secrets and ConfigMaps, or keys of them, that do not exist."""
    known, missing = provided(objects), []
    for template in pod_templates(objects):
        for kind, fields in POD_FIELDS.items():
            for field in fields:
                *_, last = field.split("/")
                for holder in holders(template["spec"], field.split("/")):
                    name = (kind, holder[last])
                    if name not in known or ("key" in holder and holder["key"] not in known[name]):
                        missing.append(f"{kind} {holder[last]} {holder.get('key', '')}".strip())
    return missing


@pytest.fixture
def objects() -> list[dict[str, Any]]:
    return render(KUBERNETES)


def test_every_secret_and_config_map_of_a_pod_exists(objects):
    assert not missing_objects(objects)
    assert len(provided(objects)) == 5


@pytest.mark.ci
def test_kustomize_renders_no_reference_to_a_missing_object(tmp_path):
    programs = ({"kustomize": "build", "kubectl": "kustomize"}).items()
    command = next(([found, verb] for name, verb in programs if (found := shutil.which(name))), None)
    if command is None:
        pytest.skip("needs kustomize or kubectl")
    folder = shutil.copytree(KUBERNETES, tmp_path / "base")
    (folder / "secrets").mkdir()
    for entry in read(folder / "kustomization.yaml")["secretGenerator"]:
        for file in entry["files"]:
            (folder / file.partition("=")[2]).write_text("secret")
    done = subprocess.run([*command, folder], capture_output=True, text=True, timeout=60, check=True)
    rendered = list(yaml.safe_load_all(done.stdout))
    assert not missing_objects(rendered)
    assert len(pod_templates(rendered)) == 4


def test_every_selector_of_the_manifests_selects_pods(objects):
    labels = [template["metadata"]["labels"] for template in pod_templates(objects)]
    selectors = [document["spec"]["selector"] for document in objects if document["kind"] == "Service"] + [
        selector["matchLabels"]
        for document in objects
        for path in (
            "spec/selector/matchLabels",
            "spec/podSelector/matchLabels",
            "spec/ingress/from/podSelector/matchLabels",
            "spec/template/spec/topologySpreadConstraints/labelSelector/matchLabels",
        )
        for selector in holders(document, path.split("/"))
    ]
    assert len(selectors) >= 10
    for selector in selectors:
        assert any(selector.items() <= each.items() for each in labels), selector


def test_every_named_port_of_the_manifests_exists(objects):
    ports = {
        template["metadata"]["labels"]["app"]: {
            port["name"]
            for holder in holders(template["spec"], ["containers", "ports"])
            for port in holder["ports"]
        }
        for template in pod_templates(objects)
    }
    for template in pod_templates(objects):
        for container in template["spec"]["containers"]:
            own = {port["name"] for port in container.get("ports", [])}
            for probe in ("readinessProbe", "livenessProbe"):
                for holder in holders(container, [probe, "httpGet", "port"]):
                    assert holder["port"] in own
    for document in objects:
        if document["kind"] == "Service":
            assert {port["targetPort"] for port in document["spec"]["ports"]} <= ports[
                document["spec"]["selector"]["app"]
            ]
        if document["kind"] == "NetworkPolicy":
            for holder in holders(document, ["spec", "ingress", "ports", "port"]):
                assert holder["port"] in ports[document["spec"]["podSelector"]["matchLabels"]["app"]]


def test_every_volume_that_a_container_mounts_exists(objects):
    for template in pod_templates(objects):
        volumes = {volume["name"] for volume in template["spec"]["volumes"]}
        mounts = {
            mount["name"]
            for container in template["spec"]["containers"]
            for mount in container["volumeMounts"]
        }
        assert mounts == volumes


def test_every_secret_file_of_a_setting_is_mounted(objects):
    known = provided(objects)
    shared = {each["metadata"]["name"]: each["data"] for each in objects if each["kind"] == "ConfigMap"}
    checked = 0
    for template in pod_templates(objects):
        secrets = {
            volume["name"]: volume["secret"]["secretName"]
            for volume in template["spec"]["volumes"]
            if "secret" in volume
        }
        for container in template["spec"]["containers"]:
            settings = {each["name"]: each.get("value", "") for each in container.get("env", [])}
            for source in container.get("envFrom", []):
                settings |= shared[source["configMapRef"]["name"]]
            files = {
                f"{mount['mountPath']}/{key}"
                for mount in container["volumeMounts"]
                if mount["name"] in secrets
                for key in known["Secret", secrets[mount["name"]]]
            }
            named = {value for value in settings.values() if value.startswith("/run/secrets/")}
            assert named <= files
            checked += len(named)
    assert checked == 5


def test_the_guide_of_kubernetes_creates_every_secret():
    guide = (ROOT / "docs/how-to/deploy-on-kubernetes.md").read_text()
    for entry in read(KUBERNETES / "kustomization.yaml")["secretGenerator"]:
        for file in entry["files"]:
            assert f"> {file.partition('=')[2]}" in guide
