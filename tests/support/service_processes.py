"""`islands serve` as a process tree on a free port, with an HTTP client and its processes by role."""

import os
import signal
import socket
import ssl
import subprocess
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import httpx

from support.command_line import ISLANDS, write_hysteresis
from support.processes import alive, descendants, eventually

#: Part of the command line of each role. The actors, the raylet and the GCS are processes of Ray.
ROLES = {
    "api": "-m islands_api",
    "coordinator": "-m islands_service.coordinator",
    "reader": "-m islands_service.intake.fork_server",
    "head": "-m islands_service.runtime.ray_head",
    "raylet": "raylet/raylet ",
    "gcs": "gcs/gcs_server ",
    "island": "ray::IslandActor",
}

TERMINAL = ("succeeded", "failed", "cancelled")

#: A search with some hundred epochs, each a few milliseconds long.
SPEC = {
    "inputs": ["u_V"],
    "output": "y_um",
    "seed": 2,
    "settings": {"population": 30, "max_terms": 5, "shooting": 200, "islands": 2, "migrate_every": 1},
}

#: Searches on Ray, although tests are short, and frequent checkpoints for the same reason. One coordinator,
#: because most tests have one job.
QUICK = {
    "ISLANDS_SHORT_SEARCH": "0",
    "ISLANDS_CHECKPOINT_EVERY": "0.5",
    "ISLANDS_RATE": "0",
    "ISLANDS_COORDINATORS": "1",
}


def free_port() -> int:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
        return port


def started(*options: object, log: IO[str] | None = None, **environment: str) -> subprocess.Popen[str]:
    """Start ``islands serve``; its output goes to a file, or to a pipe at ``stderr``."""
    return subprocess.Popen(
        [ISLANDS, "serve", *map(str, options)],
        env={**os.environ, **QUICK, **environment},
        stdout=subprocess.DEVNULL,
        stderr=log or subprocess.PIPE,
        text=True,
    )


class Service:
    """Running service with a client that retries after lost connections."""

    def __init__(
        self,
        process: subprocess.Popen[str],
        url: str,
        folder: Path,
        tls: ssl.SSLContext | None = None,
        patience: float = 60.0,
    ) -> None:
        self.process, self.url, self.folder, self.patience = process, url, folder, patience
        self.log = folder.with_suffix(".log")
        self.client = httpx.Client(base_url=url, timeout=30.0, verify=tls or True, trust_env=False)
        self._dataset = ""

    def ask(self, method: str, path: str, **asked: Any) -> httpx.Response:
        """Send a request; retry while the connection is lost, or the database is away or in doubt."""
        deadline = time.monotonic() + self.patience
        while True:
            try:
                answer = self.client.request(method, path, **asked)
                if answer.status_code not in (503, 504):
                    return answer
            except httpx.TransportError:
                if time.monotonic() > deadline:
                    raise
            assert time.monotonic() < deadline, self.log.read_text()
            time.sleep(0.02)

    def ready(self) -> None:
        assert self.ask("GET", "/readyz").status_code == 200

    def pids(self, role: str) -> list[int]:
        """Return the living processes of a role of this service, oldest first."""
        found = descendants(self.process.pid)
        return alive(sorted(pid for pid, line in found.items() if ROLES[role] in line))

    def one(self, role: str) -> int:
        """Return a process of a role; wait until there is one."""
        found: list[int] = eventually(lambda: self.pids(role))  # type: ignore[assignment]
        return found[0]

    @property
    def dataset(self) -> str:
        """Id of the data set of all jobs; uploaded at the first use."""
        if not self._dataset:
            path = self.folder.with_suffix(".csv")
            if not path.exists():
                write_hysteresis(path)
            answer = self.ask("POST", "/v1/datasets", files={"file": (path.name, path.read_bytes())})
            assert answer.status_code in (200, 201), answer.text
            self._dataset = answer.json()["id"]
        return self._dataset

    def submit(self, generations: int, key: str | None = None, **changes: Any) -> str:
        spec = {**SPEC, "dataset": self.dataset, **changes}
        spec["settings"] = {**SPEC["settings"], "generations": generations, **changes.get("settings", {})}  # type: ignore[dict-item]
        headers = {} if key is None else {"Idempotency-Key": key}
        answer = self.ask("POST", "/v1/jobs", json=spec, headers=headers)
        assert answer.status_code == 202, answer.text
        identity: str = answer.json()["id"]
        return identity

    def job(self, job: str) -> dict[str, Any]:
        answer = self.ask("GET", f"/v1/jobs/{job}")
        assert answer.status_code == 200, answer.text
        document: dict[str, Any] = answer.json()
        return document

    def generation(self, job: str) -> int:
        return int((self.job(job)["progress"] or {}).get("generation", 0))

    def under_way(self, job: str, generation: int = 10) -> int:
        """Wait until a job has reached a generation; return its current one."""
        return int(str(eventually(lambda: (at := self.generation(job)) >= generation and at)))

    def ended(self, job: str, seconds: float = 240.0) -> dict[str, Any]:
        """Wait until a job has ended and return it."""
        deadline, tag = time.monotonic() + seconds, ""
        while True:
            answer = self.ask(
                "GET", f"/v1/jobs/{job}", params={"wait": 5}, headers={"If-None-Match": tag} if tag else {}
            )
            if answer.status_code == 200:
                document: dict[str, Any] = answer.json()
                tag = answer.headers["etag"]
                if document["state"] in TERMINAL:
                    return document
            assert time.monotonic() < deadline, (self.job(job), self.log.read_text())

    def models(self, job: str) -> bytes:
        """Return the response of ``GET /v1/jobs/{id}/models``, byte for byte."""
        answer = self.ask("GET", f"/v1/jobs/{job}/models")
        assert answer.status_code == 200, answer.text
        return answer.content

    def found(self, job: str, seconds: float = 120.0) -> bytes:
        """Wait until a job has succeeded and return its models."""
        ended = self.ended(job, seconds)
        assert ended["state"] == "succeeded", ended
        return self.models(job)

    def stop(self, seconds: float = 60.0) -> int:
        """Stop the service with SIGTERM and return its exit status."""
        self.process.terminate()
        return self.process.wait(seconds)


@contextmanager
def serving(
    folder: Path,
    *options: object,
    port: int | None = None,
    tls: ssl.SSLContext | None = None,
    environment: Mapping[str, str] | None = None,
    patience: float = 60.0,
) -> Iterator[Service]:
    """Run a service on a data folder; at the end, stop it and wait for all its processes."""
    port = port or free_port()
    with folder.with_suffix(".log").open("a") as log:
        process = started("--data-dir", folder, "--port", port, *options, log=log, **environment or {})
    service = Service(process, f"http{'s' if tls else ''}://127.0.0.1:{port}", folder, tls, patience)
    children: dict[int, str] = {}
    try:
        service.ready()
        yield service
        children = descendants(process.pid)
    finally:
        service.client.close()
        if process.poll() is None:
            children = {**children, **descendants(process.pid)}
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(60)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
    eventually(lambda: not alive(children), seconds=120.0)
