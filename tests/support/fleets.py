"""Several API processes and coordinators over one database and one data folder, each behind its own proxy."""

import os
import secrets
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import httpx

from islands_service.store import Store
from support.databases import Server, server
from support.processes import eventually
from support.ray_head import ray_head
from support.service_processes import QUICK, Service, free_port
from support.tcp_proxy import TCPProxy, proxied

#: Seconds of a lease.
LEASE = 3.0

#: Numbers of processes.
APIS, COORDINATORS = 3, 2


@dataclass
class Answers:
    """Answers of all API processes to requests that were sent continually.

    Attributes
    ----------
    statuses : dict
        Number of answers of each status; 0 means a lost connection.
    problems : set of str
        Types of the problems.
    slowest : float
        Longest time of an answer in seconds.
    """

    statuses: dict[int, int] = field(default_factory=dict)
    problems: set[str] = field(default_factory=set)
    slowest: float = 0.0


@dataclass
class Fleet:
    """Running processes with their proxies; each service is an API process with its client."""

    database: Server
    services: list[Service]
    coordinators: list["subprocess.Popen[bytes]"]
    proxies: list[TCPProxy]
    log: Path

    @property
    def processes(self) -> list["subprocess.Popen[bytes]"]:
        return [*(each.process for each in self.services), *self.coordinators]  # type: ignore[list-item]

    def proxy_of(self, name: str) -> TCPProxy:
        """Return the proxy between a coordinator and the database."""
        return self.proxies[APIS + int(name.removeprefix("coordinator-"))]

    @contextmanager
    def asked_continually(self) -> Iterator[Answers]:
        """Send requests to all API processes while the block runs."""
        answers, over = Answers(), threading.Event()
        threads = [
            threading.Thread(target=_ask_until, args=(over, service.url, answers, path))
            for service in self.services
            for path in ("/v1/jobs", "/readyz", "/v1/jobs/unknown/cancel")
        ]
        for thread in threads:
            thread.start()
        try:
            yield answers
        finally:
            over.set()
            for thread in threads:
                thread.join()


def _ask_until(over: threading.Event, url: str, answers: Answers, path: str) -> None:
    with httpx.Client(base_url=url, timeout=120.0, trust_env=False) as client:
        while not over.wait(0.3):
            began = time.monotonic()
            try:
                answer = client.request("POST" if path.endswith("cancel") else "GET", path)
                status = answer.status_code
                if status >= 400:
                    answers.problems.add(answer.json()["type"])
            except httpx.TransportError:
                status = 0
            answers.statuses[status] = answers.statuses.get(status, 0) + 1
            answers.slowest = max(answers.slowest, time.monotonic() - began)


@contextmanager
def fleet(folder: Path) -> Iterator[Fleet]:
    """Start a PostgreSQL server, a Ray head, three API processes and two coordinators."""
    os.environ.setdefault("RAY_AUTH_TOKEN", secrets.token_hex(16))
    folder.mkdir()
    with ExitStack() as stack:
        database = stack.enter_context(server())
        Store(database.url).close()
        proxies = [stack.enter_context(proxied(database.socket)) for _ in range(APIS + COORDINATORS)]
        log = folder.with_suffix(".log")
        stream = stack.enter_context(log.open("a"))
        (folder / "ray").mkdir()
        address = stack.enter_context(ray_head(folder / "ray"))
        shared = {
            **os.environ,
            **QUICK,
            "ISLANDS_DATA_DIR": str(folder),
            "ISLANDS_RAY_ADDRESS": address,
            "ISLANDS_LEASE": str(LEASE),
            "RAY_AUTH_MODE": "token",
        }

        def start(proxy: TCPProxy, *command: str, **settings: str) -> "subprocess.Popen[bytes]":
            url = f"postgresql+psycopg://islands@127.0.0.1:{proxy.port}/postgres"
            environment = {**shared, "ISLANDS_DATABASE": url, **settings}
            process = subprocess.Popen(
                [sys.executable, "-m", *command], env=environment, stdout=stream, stderr=stream
            )
            stack.callback(_end, process)
            return process

        services = []
        for proxy in proxies[:APIS]:
            port = free_port()
            process = start(proxy, "islands_api", ISLANDS_PORT=str(port))
            services.append(Service(process, f"http://127.0.0.1:{port}", folder))  # type: ignore[arg-type]
            stack.callback(services[-1].client.close)
        coordinators = [
            start(proxy, "islands_service.coordinator", "--name", f"coordinator-{index}")
            for index, proxy in enumerate(proxies[APIS:])
        ]
        for service in services:
            service.ready()
        eventually(lambda: log.read_text().count("connected to Ray") >= COORDINATORS)
        yield Fleet(database, services, coordinators, proxies, log)


def _end(process: "subprocess.Popen[bytes]") -> None:
    if process.poll() is None:
        process.send_signal(signal.SIGCONT)
        process.terminate()
        try:
            process.wait(60)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
