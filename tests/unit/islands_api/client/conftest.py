"""What the laws of the client need: a service, both clients in one manner, and lines that can be cut.

The coordinator's part is played by the tests: they claim a job in the store, tell of it and finish it.
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

#: To read the authorities that a system trusts takes longer than most tests.
TRUST = ssl.create_default_context()

Answer = tuple[int, dict[str, str], bytes]


class Awaited:
    """An `AsyncClient` whose every call is awaited at once, so that one law holds for both clients."""

    def __init__(self, *arguments: Any, **named: Any) -> None:
        self.client = AsyncClient(*arguments, **named)
        self._runner = asyncio.Runner()

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self.client, name)

        def call(*arguments: Any, **named: Any) -> Any:
            begun = method(*arguments, **named)
            return self._each(begun) if inspect.isasyncgen(begun) else self._runner.run(begun)

        return call

    def _each(self, items: Any) -> Iterator[Any]:
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
    """A service that limits no rate. Each test has an owner of its own in it."""
    with serve(rate=0) as running:
        yield running


@dataclass(frozen=True, slots=True)
class Me:
    """Whose test it is."""

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
    """What makes a client, of either kind; it tries again for two seconds unless told otherwise."""
    with ExitStack() as stack:

        def make(url: str, key: str | None = None, **options: Any) -> Any:
            client = request.param(url, key, **{"verify": TRUST, "retry": 2.0, **options})
            return stack.enter_context(closing(client))

        yield make


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the client try again sooner than it does: for tests of what it does, not when."""
    monkeypatch.setattr(transport, "DELAYS", (0.03, 0.06))
    monkeypatch.setattr(transport, "LAST_DELAY", 0.1)


@pytest.fixture
def pauses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The seconds for which the client waits before it asks again; it does not wait here."""
    made: list[float] = []

    async def pause(seconds: float) -> None:
        made.append(seconds)

    monkeypatch.setattr(synchronous, "sleep", made.append)
    monkeypatch.setattr(asynchronous, "sleep", pause)
    return made


@pytest.fixture
def client(connect: Callable[..., Any], service: Service, me: Me) -> Any:
    """A client of the service."""
    return connect(service.url, me.secret)


@pytest.fixture
def claimed(service: Service) -> Callable[[Any], Lease]:
    """What claims a job, as its coordinator."""

    def claim(job: Any) -> Lease:
        while True:
            # Those of earlier tests come first.
            lease = service.store.leases.claim(uuid4().hex, LONG)
            assert lease is not None
            if lease.job.id == job.id:
                return lease

    return claim


@pytest.fixture
def later() -> Iterator[Callable[..., None]]:
    """What does something in a while, beside the test; when that ends it is done, and has not failed."""
    with ExitStack() as stack:

        def start(seconds: float, action: Callable[..., Any], *arguments: Any) -> None:
            failed: list[BaseException] = []

            def act() -> None:
                time.sleep(seconds)
                try:
                    action(*arguments)
                except BaseException as error:  # told where the test can see it
                    failed.append(error)

            def end() -> None:
                thread.join()
                assert not failed, failed

            thread = threading.Thread(target=act)
            thread.start()
            stack.callback(end)

        yield start


class Wire:
    """A line to a service. Its next connections pass so many bytes of answers each, and are cut then.

    Attributes
    ----------
    cuts : list of int
        For the next connections, one after the other; one beyond them is not cut. With 0 a connection is cut
        when the service answers: it has carried out what was asked by then.
    asked : int
        Connections so far.
    """

    def __init__(self, port: int) -> None:
        self._target, self._port = port, 0
        self.cuts: list[int] = []
        self.asked = 0
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
        """Refuse connections, and end those that there are."""
        self._end(self._listener)
        self.interrupt()
        for thread in self._threads:
            thread.join()
        self._threads.clear()

    def outage(self, seconds: float) -> None:
        """Refuse connections for a while: one after the other, however late the thread that does it is."""
        self.tear()
        time.sleep(seconds)
        self.mend()

    def interrupt(self) -> None:
        """End the connections that there are."""
        with self._lock:
            for each in self._open:
                with suppress(OSError):
                    each.shutdown(socket.SHUT_RDWR)

    def _start(self, target: Callable[..., None], *arguments: Any) -> None:
        thread = threading.Thread(target=target, args=arguments)
        thread.start()
        self._threads.append(thread)

    def _accept(self, listener: socket.socket) -> None:
        with suppress(OSError):  # it was closed
            while True:
                near, _ = listener.accept()
                far = socket.create_connection((LOOPBACK, self._target))
                self.asked += 1
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
    """A line to the service."""
    line = Wire(service.port)
    try:
        yield line
    finally:
        line.tear()


@dataclass(slots=True)
class Script:
    """A server that answers what it is told to, and keeps what it was asked, and when.

    It stands for what cannot be had from the service at will: one that has no time, and what is none at all.
    """

    url: str
    answers: list[Answer]
    asked: list[tuple[float, str, dict[str, str]]] = field(default_factory=list)


@pytest.fixture
def scripted() -> Iterator[Callable[..., Script]]:
    """What makes a server that gives some answers in turn; the last one stays."""
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
                    script.asked.append((time.monotonic(), self.path, dict(self.headers)))
                    status, headers, body = script.answers[0]
                    if len(script.answers) > 1:
                        script.answers.pop(0)
                    over.wait(delay)
                    self.send_response(status)
                    for name, value in {**headers, "Content-Length": str(len(body))}.items():
                        self.send_header(name, value)
                    self.end_headers()
                    self.wfile.write(body)

                do_POST = do_DELETE = do_GET  # noqa: N815 - the names are the library's

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
