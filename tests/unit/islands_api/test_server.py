"""Web server: small responses without delay, clear errors, and limits of a request."""

import asyncio
import json
import select
import socket
import time
from collections.abc import Iterator
from contextlib import suppress

import pytest

from islands.errors import SettingsError
from islands_api import server
from support.service import PROBLEM, Service, served

#: Start of a request with a body in chunks, and headers that are too large together.
CHUNKED = b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n"
LARGE = 70 * (b"X: " + 1000 * b"x" + b"\r\n")


@pytest.mark.parametrize("host", ["127.0.0.1", "::1"])
def test_accepted_connections_send_small_responses_at_once(host: str) -> None:
    """With Nagle's algorithm each response on a kept connection takes 40 ms."""

    async def read_options() -> tuple[int, int]:
        accepted = asyncio.get_running_loop().create_future()
        with server.open_listener(host, 0) as listening:
            answering = await asyncio.start_server(
                lambda _, writer: accepted.set_result(writer), sock=listening
            )
            async with answering:
                _, client = await asyncio.open_connection(*listening.getsockname()[:2])
                writer = await accepted
                connection = writer.get_extra_info("socket")
                delayed = connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)
                reused = listening.getsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR)
                for each in (client, writer):
                    each.close()
                    await each.wait_closed()
        return delayed, reused

    nodelay, reuse = asyncio.run(read_options())
    assert nodelay
    assert reuse


def test_an_address_of_another_machine_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"cannot listen at 192\.0\.2\.1, port 1234 .*as --host"):
        server.open_listener("192.0.2.1", 1234)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with served(tmp_path_factory.mktemp("service") / "data") as running:
        yield running


@pytest.fixture
def short_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "HEADER_TIMEOUT", 0.5)


def exchange(service: Service, sent: bytes = b"") -> tuple[int, dict[str, str], bytes]:
    """Send bytes; return status, headers and body of everything received until the end."""
    with socket.create_connection(("127.0.0.1", service.port), timeout=20.0) as connection:
        connection.sendall(sent)
        received = b""
        while more := connection.recv(65_536):
            received += more
    return read_answers(received)


def exchange_slowly(service: Service, before: bytes) -> tuple[int, dict[str, str], bytes]:
    """Send a request, then a byte every 0.05 s until the service closes the connection, for 20 s at most."""
    with socket.create_connection(("127.0.0.1", service.port), timeout=20.0) as connection:
        connection.sendall(before)
        line = iter(b"GET /" + 400 * b"a")
        received, until = b"", time.monotonic() + 20.0
        # A byte that the service receives after it has closed the connection resets it, behind the answer.
        with suppress(ConnectionResetError, BrokenPipeError):
            while time.monotonic() < until:
                if select.select([connection], [], [], 0.05)[0]:
                    if not (more := connection.recv(65_536)):
                        break
                    received += more
                elif PROBLEM.encode() not in received:
                    connection.sendall(bytes([next(line)]))
    return read_answers(received)


def read_answers(received: bytes) -> tuple[int, dict[str, str], bytes]:
    """Return status, headers and body of the last one of some answers."""
    if not received:
        return 0, {}, b""
    head, _, body = received.rpartition(b"\r\n\r\n")
    status, *lines = head.rpartition(b"HTTP/1.1 ")[2].decode().split("\r\n")
    headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines)}
    return int(status.split()[0]), headers, body


@pytest.mark.parametrize(
    ("sent", "status", "kind"),
    [
        (b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03\r\n\r\n", 400, "bad-request"),
        (b"GET / HTTP/9\r\n\r\n", 400, "bad-request"),
        (b"GET / HTTP/1.1\r\n\r\n", 400, "bad-request"),
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: x\r\n\r\n", 400, "bad-request"),
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nHost: 127.0.0.2\r\n\r\n", 400, "bad-request"),
        (CHUNKED + b"Content-Length: 2\r\n\r\n2\r\n{}\r\n0\r\n\r\n", 400, "bad-request"),
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: " + 70_000 * b"x", 431, "headers-too-large"),
        (b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n" + LARGE + b"\r\n", 431, "headers-too-large"),
        (CHUNKED + b"\r\n2\r\n{}\r\n0\r\n" + LARGE + b"\r\n", 431, "headers-too-large"),
    ],
)
def test_a_request_that_is_not_http_is_a_problem(
    service: Service, sent: bytes, status: int, kind: str
) -> None:
    found, headers, body = exchange(service, sent)
    document = json.loads(body)
    assert found == document["status"] == status
    assert document["type"] == f"/problems/{kind}"
    assert document["request_id"] == headers["x-request-id"]
    assert headers["content-type"] == PROBLEM
    assert headers["connection"] == "close"
    assert headers["x-content-type-options"] == "nosniff"
    described = service.client.get(f"/problems/{kind}").json()
    assert (described["title"], described["status"]) == (document["title"], status)


def test_a_request_before_one_that_is_not_http_is_answered(service: Service) -> None:
    status, headers, body = exchange(service, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n?!\r\n\r\n")
    assert (status, json.loads(body)["status"]) == (200, "alive")
    assert headers["connection"] == "close"


@pytest.mark.usefixtures("short_deadline")
def test_a_connection_without_a_request_is_closed(service: Service) -> None:
    began = time.monotonic()
    status, _, body = exchange(service)
    assert (status, body) == (0, b"")
    assert time.monotonic() - began > 0.4


@pytest.mark.usefixtures("short_deadline")
@pytest.mark.parametrize("before", [b"", b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"])
def test_headers_that_arrive_byte_by_byte_time_out(service: Service, before: bytes) -> None:
    """Each byte must not extend the deadline, also not that of a later request of the connection."""
    status, headers, body = exchange_slowly(service, before)
    assert status == 408
    assert json.loads(body)["type"] == "/problems/request-timeout"
    assert headers["connection"] == "close"


@pytest.mark.usefixtures("short_deadline")
def test_a_request_in_progress_has_no_deadline_for_headers(service: Service) -> None:
    connection = socket.create_connection(("127.0.0.1", service.port), timeout=10.0)
    with connection:
        connection.sendall(
            b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
            b"Content-Length: 2\r\n\r\n"
        )
        time.sleep(0.7)
        connection.sendall(b"{}")
        assert connection.recv(65_536).startswith(b"HTTP/1.1 422 ")
