"""`islands serve` as a process tree on a free port, with its client and its processes by role."""

import os
import signal
import socket
import ssl
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from support.command_line import ISLANDS
from support.processes import alive, descendants, eventually
from support.service_client import ServiceClient

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


class Service(ServiceClient):
    """Running ``islands serve`` with its client and its processes."""

    def __init__(
        self,
        process: subprocess.Popen[str],
        url: str,
        folder: Path,
        tls: ssl.SSLContext | None = None,
        patience: float = 60.0,
    ) -> None:
        super().__init__(url, folder, tls, patience)
        self.process = process

    def pids(self, role: str) -> list[int]:
        """Return the living processes of a role of this service, oldest first."""
        found = descendants(self.process.pid)
        return alive(sorted(pid for pid, line in found.items() if ROLES[role] in line))

    def one(self, role: str) -> int:
        """Return a process of a role; wait until there is one."""
        found: list[int] = eventually(lambda: self.pids(role))  # type: ignore[assignment]
        return found[0]

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
