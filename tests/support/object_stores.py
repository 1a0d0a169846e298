"""An object store in memory, and one on this machine that speaks the protocol of S3."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import time
from typing import Any

import httpx
import pytest

from islands_service.store.buckets import ObjectNotFoundError, ObjectStoreError

#: Credentials that the simulated store accepts, like all others.
ACCESS = {"AWS_ACCESS_KEY_ID": "islands", "AWS_SECRET_ACCESS_KEY": "a secret", "AWS_REGION": "us-east-1"}


class MemoryObjects:
    """`ObjectStore` in memory. ``away`` makes it fail, ``times`` has the time of each object."""

    def __init__(self) -> None:
        self.url = "s3://memory"
        self.objects: dict[str, bytes] = {}
        self.times: dict[str, float] = {}
        self.away = False
        self.calls: list[str] = []
        self.observe: Callable[[str, str, float], None] = lambda *_: None

    def put(self, key: str, path: Path) -> None:
        self._enter("put")
        self.objects[key], self.times[key] = path.read_bytes(), time()

    def get(self, key: str, path: Path) -> None:
        self._enter("get")
        if key not in self.objects:
            raise ObjectNotFoundError(key)
        path.write_bytes(self.objects[key])

    def move(self, key: str, to: str) -> None:
        self._enter("move")
        if key not in self.objects:
            raise ObjectNotFoundError(key)
        self.objects[to], self.times[to] = self.objects[key], time()
        self.delete(key)

    def delete(self, key: str) -> None:
        self._enter("delete")
        self.objects.pop(key, None)
        self.times.pop(key, None)

    def all(self) -> Iterator[tuple[str, float]]:
        self._enter("list")
        yield from [(key, self.times[key]) for key in self.objects]

    def check(self) -> None:
        self._enter("check")

    def age(self, seconds: float = 7200.0) -> None:
        """Let all objects have been stored earlier."""
        self.times = {key: at - seconds for key, at in self.times.items()}

    def _enter(self, call: str) -> None:
        self.calls.append(call)
        if self.away:
            raise ObjectStoreError("away")


@contextmanager
def s3_server(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Serve an empty store on this machine, to which the environment points; yield its endpoint."""
    from moto.server import ThreadedMotoServer

    for name, value in ACCESS.items():
        monkeypatch.setenv(name, value)
    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    host, port = server.get_host_and_port()
    endpoint = f"http://{host}:{port}"
    monkeypatch.setenv("AWS_ENDPOINT_URL", endpoint)
    try:
        yield endpoint
    finally:
        server.stop()


def make_bucket(endpoint: str, name: str = "bucket") -> Any:
    """Make a bucket; return a client of the store."""
    import boto3

    client = boto3.client("s3", endpoint_url=endpoint)
    client.create_bucket(Bucket=name)
    return client


@dataclass
class CuttingProxy:
    """Proxy to a TCP server.

    Attributes
    ----------
    cut_after : list of int
        For each of the next connections the bytes of the client after which it is cut; then none is.
    refuse : bool
        Whether new connections are closed at once.
    """

    target: tuple[str, int]
    cut_after: list[int] = field(default_factory=list)
    cut_answer_after: list[int] = field(default_factory=list)
    refuse: bool = False
    port: int = 0

    def __enter__(self) -> "CuttingProxy":
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self.port = self._listener.getsockname()[1]
        self._open: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        _close(self._listener, *self._open)

    def vanish(self) -> None:
        """Cut all connections, and refuse new ones until ``refuse`` is set to False."""
        self.refuse = True
        _close(*self._open)

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                if self.refuse:
                    client.close()
                    continue
                server = socket.create_connection(self.target)
                self._open += [client, server]
                for source, sink, cuts in (
                    (client, server, self.cut_after),
                    (server, client, self.cut_answer_after),
                ):
                    most = cuts.pop(0) if cuts else None
                    threading.Thread(target=_pump, args=(source, sink, most), daemon=True).start()


def _pump(source: socket.socket, sink: socket.socket, most: int | None) -> None:
    passed = 0
    with suppress(OSError):
        while data := source.recv(65_536):
            data = data if most is None else data[: most - passed]
            sink.sendall(data)
            passed += len(data)
            if passed == most:
                break
    _close(source, sink)


def _close(*sockets: socket.socket) -> None:
    for each in sockets:
        with suppress(OSError):
            each.shutdown(socket.SHUT_RDWR)
        each.close()


@contextmanager
def authentication(endpoint: str) -> Iterator[None]:
    """Let the simulated store refuse all credentials during the block: it knows none."""
    httpx.post(f"{endpoint}/moto-api/reset-auth", content="0", trust_env=False)
    try:
        yield
    finally:
        httpx.post(f"{endpoint}/moto-api/reset-auth", content="inf", trust_env=False)
