"""The service behind nginx and Caddy, with the configurations of the deployment guide."""

import json
import re
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx
import pytest

from islands_service.domain.job import ProgressReport
from support.repository import ROOT
from support.service import Service, csv, problem_of, spec
from support.service_processes import free_port

pytestmark = pytest.mark.ci

#: Starts a proxy on a port that forwards to another port, with its files in a folder.
Proxy = Callable[[int, int, Path], "subprocess.Popen[bytes]"]

GUIDE = (ROOT / "docs/how-to/deploy-the-service.md").read_text()


def server_block() -> str:
    """Return the server block of nginx of the guide."""
    found = re.search(r"```nginx\n(server \{.*?\n\})\n```", GUIDE, re.DOTALL)
    assert found
    return found[1]


def run_nginx(block: str) -> Proxy:
    def start(port: int, upstream: int, folder: Path) -> "subprocess.Popen[bytes]":
        server = block.replace("listen 443 ssl", f"listen 127.0.0.1:{port}").replace(
            "127.0.0.1:8000", f"127.0.0.1:{upstream}"
        )
        temporary = "".join(
            f"{kind}_temp_path {folder / kind};\n"
            for kind in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
        )
        (folder / "nginx.conf").write_text(
            f"daemon off;\nmaster_process off;\npid {folder / 'pid'};\nerror_log stderr;\n"
            f"events {{}}\nhttp {{\naccess_log off;\n{temporary}{server}\n}}\n"
        )
        return subprocess.Popen(["nginx", "-c", folder / "nginx.conf", "-p", folder])

    return start


def run_caddy(port: int, upstream: int, folder: Path) -> "subprocess.Popen[bytes]":
    found = re.search(r"`islands\.example\.org (\{ reverse_proxy .* \})`", GUIDE)
    assert found
    site = found[1].replace("127.0.0.1:8000", f"127.0.0.1:{upstream}")
    inner = site.removeprefix("{").removesuffix("}").strip()
    (folder / "Caddyfile").write_text(
        f"{{\n  admin off\n  auto_https off\n}}\nhttp://127.0.0.1:{port} {{\n  {inner}\n}}\n"
    )
    return subprocess.Popen(
        ["caddy", "run", "--config", folder / "Caddyfile", "--adapter", "caddyfile"],
        env={"HOME": str(folder), "PATH": "/usr/bin:/bin"},
        stderr=subprocess.DEVNULL,
    )


#: The default of nginx, which is nothing but the address of the upstream.
PLAIN = "server { listen 443 ssl; location / { proxy_pass http://127.0.0.1:8000; } }"

#: A prefix that nginx removes, and one that it keeps.
REMOVED = "server { listen 443 ssl; location /tools/islands/ { proxy_pass http://127.0.0.1:8000/; } }"
KEPT = "server { listen 443 ssl; location /tools/islands/ { proxy_pass http://127.0.0.1:8000; } }"

PROXIES: dict[str, tuple[str, Proxy, str]] = {
    "nginx": ("nginx", run_nginx(server_block()), ""),
    "nginx by default": ("nginx", run_nginx(PLAIN), ""),
    "nginx that removes a prefix": ("nginx", run_nginx(REMOVED), "/tools/islands"),
    "nginx that keeps a prefix": ("nginx", run_nginx(KEPT), "/tools/islands"),
    "caddy": ("caddy", run_caddy, ""),
}


@contextmanager
def forwarded(start: Proxy, upstream: int, folder: Path) -> Iterator[str]:
    """Run a proxy; yield its URL."""
    folder.mkdir()
    port = free_port()
    process = start(port, upstream, folder)
    url = f"http://127.0.0.1:{port}"
    try:
        deadline = time.monotonic() + 20.0
        while True:
            try:
                httpx.get(url, trust_env=False)
                break
            except httpx.TransportError:
                assert process.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.02)
        yield url
    finally:
        process.terminate()
        process.wait(20)


#: Proxies of the level ci: the one with the recommended settings, and one that removes a prefix.
ESSENTIAL = ("nginx", "nginx that removes a prefix")

MARKED = [name if name in ESSENTIAL else pytest.param(name, marks=pytest.mark.nightly) for name in PROXIES]


@pytest.fixture(scope="module", params=MARKED)
def proxied(request, serve, tmp_path_factory) -> Iterator[tuple[Service, httpx.Client, str]]:
    """Provide a service with keys, a client of a proxy in front of it, and the prefix of the proxy.

    The service has one data set, which is uploaded through the proxy.
    """
    program, start, prefix = PROXIES[request.param]
    if shutil.which(program) is None:
        pytest.skip(f"needs {program}: apt-get install {program}")
    with (
        serve(require_keys=True, trusted_proxies="127.0.0.1", root_path=prefix) as service,
        forwarded(start, service.port, tmp_path_factory.mktemp("proxy") / "files") as url,
        httpx.Client(base_url=url, headers=service.key(), timeout=30.0, trust_env=False) as client,
    ):
        answer = client.post(f"{prefix}/v1/datasets", files={"file": ("record.csv", csv())})
        assert answer.status_code == 201, answer.text
        yield service, client, prefix


def submit(proxied: tuple[Service, httpx.Client, str], **headers: str) -> httpx.Response:
    _, client, prefix = proxied
    (dataset,) = client.get(f"{prefix}/v1/datasets").json()["items"]
    return client.post(f"{prefix}/v1/jobs", json=spec(dataset["id"]), headers=headers)


def test_the_page_behind_a_proxy_submits_jobs(proxied):
    """Browsers send the Origin of the proxy with every POST."""
    _, client, _ = proxied
    origin = str(client.base_url).rstrip("/")
    assert submit(proxied, Origin=origin).status_code == 202
    assert submit(proxied, Origin=origin, **{"Sec-Fetch-Site": "same-origin"}).status_code == 202
    foreign = submit(proxied, Origin="https://evil.example", **{"Sec-Fetch-Site": "cross-site"})
    problem_of(foreign, 403, "cross-origin")


def test_a_location_leads_through_the_proxy_to_the_job(proxied):
    _, client, _ = proxied
    answer = submit(proxied)
    job = client.get(answer.headers["location"])
    assert (job.status_code, job.json()["id"]) == (200, answer.json()["id"])


def test_events_pass_a_proxy_as_they_happen(proxied):
    service, client, prefix = proxied
    job = submit(proxied).json()["id"]
    store = service.store
    while (lease := store.leases.claim("test", 600.0)).job.id != job:
        pass
    sent = threading.Event()
    with client.stream("GET", f"{prefix}/v1/jobs/{job}/events") as answer:
        for line in answer.iter_lines():
            if line == "event: running" and not sent.is_set():
                store.leases.report(lease, ProgressReport({"generation": 7}))
                sent.set()
            if line.startswith("data: ") and json.loads(line[6:]).get("generation") == 7:
                break
        else:
            pytest.fail("the stream has ended without the event")


def test_the_page_and_its_files_load_below_the_prefix(proxied):
    _, client, prefix = proxied
    page = client.get(f"{prefix}/")
    assert page.status_code == 200
    for path in re.findall(r'(?:src|href)="(dashboard/[^"]+)"', page.text):
        assert client.get(f"{prefix}/{path}").status_code == 200, path


def test_a_client_cannot_forge_its_address_through_a_proxy(proxied, request):
    service, client, prefix = proxied
    if request.node.callspec.params["proxied"] not in ("nginx", "caddy"):
        pytest.skip("by default nginx passes the header of the client on, which the guide changes")
    service.logs.clear()
    # Another address than that of the proxy, which is trusted.
    with httpx.Client(transport=httpx.HTTPTransport(local_address="127.0.0.2")) as other:
        headers = {"X-Forwarded-For": "203.0.113.9", **client.headers}
        assert other.get(client.base_url.join(f"{prefix}/v1/jobs"), headers=headers).status_code == 200
    (entry,) = [entry for entry in service.logs if entry["event"] == "request"]
    assert entry["client"] == "127.0.0.2"
