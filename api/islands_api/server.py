"""Web server: listening socket, HTTP protocol, and uvicorn with the configuration of this service."""

import asyncio
import json
import secrets
import socket
import sys
from errno import EADDRINUSE
from time import monotonic, sleep
from typing import Any

import structlog
import uvicorn
from fastapi import FastAPI
from starlette.exceptions import HTTPException
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from islands.errors import SettingsError
from islands_api.web.middleware import SECURITY_HEADERS
from islands_api.web.problems import (
    MEDIA_TYPE,
    HeadersTooLargeError,
    MalformedBodyError,
    ProblemKind,
    RequestTimeoutError,
    lookup_problem,
    problem_document,
)
from islands_service.settings import ServiceSettings

#: Seconds for which a port in use is tried again: its previous owner may be shutting down.
_PORT_RETRY_SECONDS = 2.0

#: Length of the queue of connections that wait to be accepted.
_BACKLOG = 2048

log = structlog.get_logger()

#: Seconds that a client has to send the complete headers of a request, from the connection on or from their
#: first byte on a kept connection.
HEADER_TIMEOUT = 10.0

#: Maximum number of headers of a request: each look-up reads all of them.
_MAX_HEADERS = 200

#: Maximum size in bytes of the request line and the headers of a request, and of the trailers of a body.
_MAX_HEADER_BYTES = 65_536

#: Seconds that open requests have to finish at shutdown.
_SHUTDOWN_SECONDS = 2

#: Seconds for which an idle connection is kept after a response.
_KEEP_ALIVE_SECONDS = 30


def open_listener(host: str, port: int) -> socket.socket:
    """Open a listening TCP socket.

    Raises
    ------
    SettingsError
        The address does not belong to this machine, or another program uses the port.
    """
    deadline = monotonic() + _PORT_RETRY_SECONDS
    while True:
        try:
            return _listen(host, port)
        except OSError as error:
            if error.errno == EADDRINUSE and monotonic() < deadline:
                sleep(0.05)
                continue
            reason = "another program uses it" if error.errno == EADDRINUSE else error.strerror
            raise SettingsError(
                f"cannot listen at {host}, port {port} ({reason}): give another --port, or an "
                "address of this machine as --host"
            ) from error


def _listen(host: str, port: int) -> socket.socket:
    # `socket.create_server` leaves the protocol number at 0. asyncio sets TCP_NODELAY only on sockets whose
    # protocol is IPPROTO_TCP. Without it every response on a kept connection is delayed by some 40 ms:
    # Nagle's algorithm waits for the acknowledgement of the headers, which the client delays.
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    try:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if family == socket.AF_INET6:
            listener.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        listener.bind((host, port))
        listener.listen(_BACKLOG)
    except BaseException:
        listener.close()
        raise
    return listener


class HTTPProtocol(HttpToolsProtocol):
    """HTTP/1.1 protocol of uvicorn with problem documents, and with limits on the headers of a request.

    uvicorn closes a kept connection that is idle, but waits for ever for the first request and for the rest
    of an incomplete one. Many such connections would use up the open files. The parser has no limit on the
    size of headers.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._deadline: asyncio.TimerHandle | None = None
        # Whether the headers of a request are incomplete, the bytes received of them, and the size of all
        # complete headers and trailers of the request.
        self._in_headers = False
        self._received_bytes = self._header_bytes = 0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the deadline of the first request."""
        super().connection_made(transport)
        self._update_deadline()

    def data_received(self, data: bytes) -> None:
        """Handle received bytes, limit incomplete headers, and start or stop the deadline."""
        super().data_received(data)
        if self._in_headers and not self.transport.is_closing():
            self._received_bytes += len(data)
            if self._received_bytes > _MAX_HEADER_BYTES:
                self._refuse(_headers_too_large())
        self._update_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the deadline."""
        super().connection_lost(exc)
        self._stop_deadline()

    def on_message_begin(self) -> None:
        """Start a request."""
        super().on_message_begin()
        self._in_headers, self._received_bytes, self._header_bytes = True, 0, 0

    def on_header(self, name: bytes, value: bytes) -> None:
        """Add a header or a trailer."""
        self._header_bytes += len(name) + len(value)
        if self._header_bytes > _MAX_HEADER_BYTES or len(self.headers) >= _MAX_HEADERS:
            raise _headers_too_large()
        if self._in_headers:
            super().on_header(name, value)

    def on_headers_complete(self) -> None:
        """Check the headers, and start the response."""
        self._in_headers = False
        hosts = sum(name == b"host" for name, _ in self.headers)
        if hosts > 1 or (hosts == 0 and self.parser.get_http_version() == "1.1"):  # RFC 9112, section 3.2
            raise MalformedBodyError(f"the request is not valid HTTP: it has {hosts} Host headers: send one")
        super().on_headers_complete()

    def send_400_response(self, msg: str) -> None:
        """Send the problem of a request that cannot be parsed, and close the connection.

        uvicorn calls it while it handles the error of the parser.
        """
        error = sys.exception()
        cause = error and error.__context__  # an error of `on_header` and the like
        if isinstance(cause, HTTPException):
            self._refuse(cause)
        else:
            self._refuse(MalformedBodyError(f"the request is not valid HTTP: {cause or error or msg}"))

    def _awaits_request(self) -> bool:
        """Return whether the connection is open, and no request is in progress."""
        return not self.transport.is_closing() and (self.cycle is None or self.cycle.response_complete)

    def _update_deadline(self) -> None:
        if not self._awaits_request():
            self._stop_deadline()
        elif self._deadline is None:
            self._deadline = self.loop.call_later(HEADER_TIMEOUT, self._handle_timeout)

    def _stop_deadline(self) -> None:
        if self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _handle_timeout(self) -> None:
        self._deadline = None
        if not self._awaits_request():
            return
        if self._in_headers:
            self._refuse(
                RequestTimeoutError(
                    f"the headers of the request were not complete within {HEADER_TIMEOUT:.0f} s: "
                    "send them at once"
                )
            )
        else:
            self.transport.close()

    def _refuse(self, error: HTTPException) -> None:
        """Send a problem, unless other responses are due or started, and close the connection."""
        request_id = secrets.token_hex(8)
        log.info(
            "request",
            client=self.client[0] if self.client else None,
            status=error.status_code,
            reason=error.detail,
            request_id=request_id,
        )
        in_body = self.cycle is not None and self.cycle.more_body
        if self._awaits_request() or (in_body and not self.cycle.response_started):
            self.transport.write(_format_response(lookup_problem(error), error.detail, request_id))
            self.transport.close()
        elif in_body:
            self.transport.close()
        else:
            # The client has sent it behind requests without waiting for their responses, which precede.
            self.cycle.keep_alive = False
            self.flow.pause_reading()


def _headers_too_large() -> HeadersTooLargeError:
    return HeadersTooLargeError("the headers of the request are too large: send fewer or shorter ones")


def _format_response(problem: ProblemKind, detail: str, request_id: str) -> bytes:
    body = json.dumps(problem_document(problem, detail, request_id)).encode()
    headers = {
        **SECURITY_HEADERS,
        "Content-Type": MEDIA_TYPE,
        "Content-Length": str(len(body)),
        "Connection": "close",
        "X-Request-ID": request_id,
    }
    head = "".join(f"{name}: {value}\r\n" for name, value in headers.items())
    return f"HTTP/1.1 {int(problem.status)} {problem.status.phrase}\r\n{head}\r\n".encode() + body


class HTTPServer(uvicorn.Server):
    """Server that closes the event streams first; they would outlast the shutdown timeout."""

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Close the event streams, then shut down."""
        self.config.app.state.islands.hub.close()  # type: ignore[union-attr]
        await super().shutdown(sockets)


def make_server_config(app: FastAPI, settings: ServiceSettings) -> uvicorn.Config:
    """Return the configuration of uvicorn for an application."""
    return uvicorn.Config(
        app,
        http=HTTPProtocol,
        ws="none",
        access_log=False,
        log_config=None,
        timeout_graceful_shutdown=_SHUTDOWN_SECONDS,
        timeout_keep_alive=_KEEP_ALIVE_SECONDS,
        ssl_certfile=settings.tls_certificate,
        ssl_keyfile=settings.tls_key,
        server_header=False,
        # Without trusted proxies the header X-Forwarded-For of any client would change its address.
        proxy_headers=bool(settings.trusted_proxies),
        forwarded_allow_ips=settings.trusted_proxies,
    )
