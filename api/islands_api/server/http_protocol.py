"""HTTP protocol of a connection: problems instead of plain text errors, and a deadline for each request."""

import asyncio
import json
import secrets
import sys
from http import HTTPStatus
from typing import Any

import h11
import structlog
from starlette.exceptions import HTTPException
from uvicorn.protocols.http.h11_impl import H11Protocol

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


class HTTPProtocol(H11Protocol):
    """HTTP/1.1 protocol of uvicorn with problem documents and a deadline for the headers of a request.

    uvicorn closes a kept connection that is idle, but waits for ever for the first request and for the rest
    of an incomplete one. Many such connections would use up the open files.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._deadline: asyncio.TimerHandle | None = None

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Start the deadline of the first request."""
        super().connection_made(transport)
        self._update_deadline()

    def data_received(self, data: bytes) -> None:
        """Handle received bytes, and start or stop the deadline."""
        super().data_received(data)
        self._update_deadline()

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop the deadline."""
        super().connection_lost(exc)
        self._stop_deadline()

    def send_400_response(self, msg: str) -> None:
        """Send the problem of a request that cannot be parsed, and close the connection.

        uvicorn calls it while it handles the error of the parser.
        """
        error = sys.exception()
        if getattr(error, "error_status_hint", None) == HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE:
            self._refuse(
                HeadersTooLargeError("the headers of the request are too large: send fewer or shorter ones")
            )
        else:
            self._refuse(MalformedBodyError(f"the request is not valid HTTP: {error or msg}"))

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
        if self.conn.trailing_data[0]:
            self._refuse(
                RequestTimeoutError(
                    f"the headers of the request were not complete within {HEADER_TIMEOUT:.0f} s: "
                    "send them at once"
                )
            )
        else:
            self.transport.close()

    def _refuse(self, error: HTTPException) -> None:
        """Send a problem, unless a response has been started, and close the connection."""
        request_id = secrets.token_hex(8)
        log.info(
            "request",
            client=self.client[0] if self.client else None,
            status=error.status_code,
            reason=error.detail,
            request_id=request_id,
        )
        if self.conn.our_state in (h11.IDLE, h11.SEND_RESPONSE):
            self.transport.write(_format_response(lookup_problem(error), error.detail, request_id))
        self.transport.close()


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
