"""Connections: requests that are not HTTP, or never complete, and idle ones."""

import json
import socket
import time
from collections.abc import Iterator

import pytest

from islands_api.server import http_protocol
from support.service import PROBLEM, Service, served

#: Start of a request with a body in chunks, and headers that are too large together.
CHUNKED = b"POST /v1/jobs HTTP/1.1\r\nHost: 127.0.0.1\r\nTransfer-Encoding: chunked\r\n"
LARGE = 70 * (b"X: " + 1000 * b"x" + b"\r\n")


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    with served(tmp_path_factory.mktemp("service") / "data") as running:
        yield running


@pytest.fixture
def short_deadline(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(http_protocol, "HEADER_TIMEOUT", 0.5)


def exchange(service: Service, *sent: bytes, pause: float = 0.0) -> tuple[int, dict[str, str], bytes, float]:
    """Send bytes; return status, headers and body of everything received until the end, and the seconds."""
    began = time.monotonic()
    with socket.create_connection(("127.0.0.1", service.port), timeout=10.0) as connection:
        for part in sent:
            connection.sendall(part)
            time.sleep(pause)
        received = b""
        while more := connection.recv(65_536):
            received += more
    seconds = time.monotonic() - began
    if not received:
        return 0, {}, b"", seconds
    head, _, body = received.rpartition(b"\r\n\r\n")
    status, *lines = head.rpartition(b"HTTP/1.1 ")[2].decode().split("\r\n")
    headers = {name.lower(): value for name, _, value in (line.partition(": ") for line in lines)}
    return int(status.split()[0]), headers, body, seconds


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
    found, headers, body, _ = exchange(service, sent)
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
    status, headers, body, _ = exchange(
        service, b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n?!\r\n\r\n"
    )
    assert (status, json.loads(body)["status"]) == (200, "alive")
    assert headers["connection"] == "close"


@pytest.mark.usefixtures("short_deadline")
def test_a_connection_without_a_request_is_closed(service: Service) -> None:
    status, _, body, seconds = exchange(service)
    assert (status, body) == (0, b"")
    assert 0.4 < seconds < 2.0


@pytest.mark.usefixtures("short_deadline")
@pytest.mark.parametrize("before", [b"", b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"])
def test_headers_that_arrive_byte_by_byte_time_out(service: Service, before: bytes) -> None:
    """Each byte must not extend the deadline, also not that of a later request of the connection."""
    status, headers, body, seconds = exchange(service, before, b"G", b"E", b"T", pause=0.1)
    assert status == 408
    assert json.loads(body)["type"] == "/problems/request-timeout"
    assert headers["connection"] == "close"
    assert seconds < 0.7  # the last byte was sent after 0.3 s


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
