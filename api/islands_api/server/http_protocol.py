"""HTTP protocol of a connection: limits of a request, and problems instead of plain text errors."""

import asyncio
import json
import secrets
import sys
from typing import Any

import structlog
from starlette.exceptions import HTTPException
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

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

log = structlog.get_logger()

#: Seconds that a client has to send the complete headers of a request, from the connection on or from their
#: first byte on a kept connection.
HEADER_TIMEOUT = 10.0


#: Maximum number of headers of a request: each look-up reads all of them.
_MAX_HEADERS = 200

#: Maximum size in bytes of the request line and the headers of a request, and of the trailers of a body.
_MAX_HEADER_BYTES = 65_536


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
