"""Fixtures of the client tests: a service, both clients behind one interface, and breakable connections.

The tests act as the coordinator: they claim a job in the store, report its progress and finish it.
"""

import asyncio
import inspect
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from uuid import uuid4

import pytest

from islands_api.client import AsyncClient, Client, asynchronous, synchronous, transport
from islands_service.domain.job import Lease
from support.service import Service, kept
from support.stores import LONG

LOOPBACK = "127.0.0.1"

#: Shared, because reading the authorities that the system trusts takes longer than most tests.
TRUST = ssl.create_default_context()

Answer = tuple[int, dict[str, str], bytes]


class Awaited:
    """`AsyncClient` whose calls are awaited immediately, so that one test covers both clients."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.client = AsyncClient(*arguments, **named)
        self._runner = asyncio.Runner()

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self.client, name)

        def call(*arguments: Any, **named: Any) -> Any:
            pending = method(*arguments, **named)
            return self._iterate(pending) if inspect.isasyncgen(pending) else self._runner.run(pending)

        return call

    def _iterate(self, items: Any) -> Iterator[Any]:
        try:
            while True:
                try:
                    yield self._runner.run(anext(items))
                except StopAsyncIteration:
                    return
        finally:
            self._runner.run(items.aclose())

    def close(self) -> None:
        self._runner.run(self.client.close())
        self._runner.close()


@pytest.fixture(scope="module")
def service(serve: Any) -> Iterator[Service]:
    """A service without a rate limit. Each test has a separate owner."""
    with serve(rate=0) as running:
        yield running


@dataclass(frozen=True, slots=True)
class Me:
    """Owner of a test."""

    owner: str
    secret: str
    dataset: str


@pytest.fixture
def me(service: Service) -> Me:
    """An owner with a key and a data set."""
    key, secret = service.store.keys.create("test", frozenset({"read", "write"}))
    return Me(key.owner, secret, kept(service.store, key.owner))


@pytest.fixture(params=[Client, Awaited], ids=["sync", "async"])
def connect(request: pytest.FixtureRequest) -> Iterator[Callable[..., Any]]:
    """Return a factory of clients of either kind, with two seconds of retries by default."""
    with ExitStack() as stack:

        def make(url: str, key: str | None = None, **options: Any) -> Any:
            client = request.param(url, key, **{"verify": TRUST, "retry": 2.0, **options})
            return stack.enter_context(closing(client))

        yield make


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Shorten the delays between attempts, for tests that do not measure them."""
    monkeypatch.setattr(transport, "RETRY_DELAYS", (0.03, 0.06))
    monkeypatch.setattr(transport, "LAST_RETRY_DELAY", 0.1)


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Seconds that the client would sleep before each repetition; it does not sleep here."""
    made: list[float] = []

    async def pause(seconds: float) -> None:
        made.append(seconds)

    monkeypatch.setattr(synchronous, "sleep", made.append)
    monkeypatch.setattr(asynchronous, "sleep", pause)
    return made


@pytest.fixture
def client(connect: Callable[..., Any], service: Service, me: Me) -> Any:
    """Client of the service."""
    return connect(service.url, me.secret)


@pytest.fixture
def administrator(connect: Callable[..., Any], service: Service) -> Any:
    """Client of an administrator."""
    _, secret = service.store.keys.create("administrator", frozenset({"admin"}))
    return connect(service.url, secret)


@pytest.fixture
def claimed(service: Service) -> Callable[[Any], Lease]:
    """Return a function that claims a job like its coordinator."""

    def claim(job: Any) -> Lease:
        while True:
            # Jobs of earlier tests are claimed first.
            lease = service.store.leases.claim(uuid4().hex, LONG)
            assert lease is not None
            if lease.job.id == job.id:
                return lease

    return claim


@pytest.fixture
def later() -> Iterator[Callable[..., None]]:
    """Return a function that runs an action in a thread after a delay; at teardown it must have succeeded."""
    with ExitStack() as stack:

        def start(seconds: float, action: Callable[..., Any], *arguments: Any) -> None:
            failed: list[BaseException] = []

            def run() -> None:
                time.sleep(seconds)
                try:
                    action(*arguments)
                except BaseException as error:  # raised in the test's thread at teardown
                    failed.append(error)

            def check() -> None:
                thread.join()
                assert not failed, failed

            thread = threading.Thread(target=run)
            thread.start()
            stack.callback(check)

        yield start


class Wire:
    """TCP proxy of a service that breaks its next connections after a number of answer bytes.

    Attributes
    ----------
    cuts : list of int
        Bytes that the next connections pass, in order; later connections are not broken. With 0 a connection
        breaks at the first byte of the answer: the service has carried out the request by then.
    connections : int
        Number of connections so far.
    """

    def __init__(self, port: int) -> None:
        self._target, self._port = port, 0
        self.cuts: list[int] = []
        self.connections = 0
        self._lock, self._open = threading.Lock(), set[socket.socket]()
        self._threads: list[threading.Thread] = []
        self.mend()

    @property
    def url(self) -> str:
        return f"http://{LOOPBACK}:{self._port}"

    def mend(self) -> None:
        """Accept connections."""
        self._listener = socket.create_server((LOOPBACK, self._port))
        self._port = self._listener.getsockname()[1]
        self._start(self._accept, self._listener)

    def tear(self) -> None:
        """Refuse connections, and close the open ones."""
        self._end(self._listener)
        self.interrupt()
        for thread in self._threads:
            thread.join()
        self._threads.clear()

    def outage(self, seconds: float) -> None:
        """Refuse connections for some seconds, in one thread so that the order is certain."""
        self.tear()
        time.sleep(seconds)
        self.mend()

    def interrupt(self) -> None:
        """Close the open connections."""
        with self._lock:
            for each in self._open:
                with suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)

    def _start(self, target: Callable[..., None], *arguments: Any) -> None:
        thread = threading.Thread(target=target, args=arguments)
        thread.start()
        self._threads.append(thread)

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):  # the listener was closed
            while True:
                near, _ = listener.accept()
                far = socket.create_connection((LOOPBACK, self._target))
                self.connections += 1
                with self._lock:
                    self._open |= {near, far}
                self._start(self._pass, near, far, self.cuts.pop(0) if self.cuts else None)

    def _pass(self, near: socket.socket, far: socket.socket, left: int | None) -> None:
        up = threading.Thread(target=self._pass_up, args=(near, far))
        up.start()
        with suppress(OSError):
            while data := far.recv(65536):
                near.sendall(data if left is None else data[:left])
                left = None if left is None else left - len(data)
                if left is not None and left <= 0:
                    break
        for each in (near, far):
            with suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
        up.join()
        with self._lock:
            self._open -= {near, far}
        for each in (near, far):
            each.close()

    def _pass_up(self, near: socket.socket, far: socket.socket) -> None:
        with suppress(OSError):
            while data := near.recv(65536):
                far.sendall(data)
            far.shutdown(socket.SHUT_RDWR)

    def _end(self, listener: socket.socket) -> None:
        with suppress(OSError):
            listener.shutdown(socket.SHUT_RDWR)
        listener.close()


@pytest.fixture
def wire(service: Service) -> Iterator[Wire]:
    """A breakable connection to the service."""
    proxy = Wire(service.port)
    try:
        yield proxy
    finally:
        proxy.tear()


@dataclass(slots=True)
class Script:
    """Server with prepared answers that records its requests and their times.

    It replaces a busy service and servers of other kinds.
    """

    url: str
    answers: list[Answer]
    requests: list[tuple[float, str, dict[str, str]]] = field(default_factory=list)


@pytest.fixture
def scripted() -> Iterator[Callable[..., Script]]:
    """Return a factory of servers that give some answers in turn and repeat the last one."""
    over = threading.Event()
    with ExitStack() as stack:

        def make(*answers: Answer, delay: float = 0.0) -> Script:
            class Handler(BaseHTTPRequestHandler):
                protocol_version = "HTTP/1.1"

                def handle_one_request(self) -> None:
                    with suppress(ConnectionError):
                        super().handle_one_request()

                def do_GET(self) -> None:
                    self.rfile.read(int(self.headers.get("content-length", 0)))
                    script.requests.append((time.monotonic(), self.path, dict(self.headers)))
                    status, headers, body = script.answers[0]
                    if len(script.answers) > 1:
                        script.answers.pop(0)
                    over.wait(delay)
                    self.send_response(status)
                    for name, value in {**headers, "Content-Length": str(len(body))}.items():
                        self.send_header(name, value)
                    self.end_headers()
                    self.wfile.write(body)

                do_POST = do_DELETE = do_GET  # noqa: N815 - names defined by the library

                def log_message(self, *_: Any) -> None:
                    pass

            server = ThreadingHTTPServer((LOOPBACK, 0), Handler)
            server.daemon_threads = True
            script = Script(f"http://{LOOPBACK}:{server.server_port}", list(answers))
            thread = threading.Thread(target=server.serve_forever, args=(0.01,))
            thread.start()
            stack.callback(server.server_close)
            stack.callback(thread.join)
            stack.callback(server.shutdown)
            stack.callback(over.set)
            return script

        yield make
