"""What happens to every request: an id, a line in the log, a time, a limit on its body, safe headers."""

import secrets
from time import perf_counter
from typing import Any
from urllib.parse import urlsplit

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from islands_api.web.exception_handlers import METHODS, internal_error, problem_response
from islands_api.web.problems import CrossOriginError, PayloadTooLargeError, problem_of
from islands_service.settings import LOOPBACK, ServiceSettings

log = structlog.get_logger()

#: Bytes of a body that is not an upload, and what a form adds to the file in it.
BODY, FORM = 1_000_000, 100_000

#: The path that takes uploads.
UPLOADS = "/v1/datasets"

#: Sent with every answer. The page of our own needs nothing from elsewhere, and nobody may frame it.
SECURITY = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
}

_TLS = {"Strict-Transport-Security": "max-age=31536000"}


class RequestLogging:
    """Gives a request an id, binds it to the log, and takes the time until the answer begins.

    An id that the client sends is kept, so that one line of work can be followed through several services.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        began = perf_counter()
        sent = Headers(scope=scope).get("x-request-id", "")
        request_id = sent if sent.isascii() and sent.isalnum() and len(sent) <= 64 else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = request_id
        secure = _TLS if scope["scheme"] == "https" else {}
        started = False

        async def sending(message: Message) -> None:
            nonlocal started
            if message["type"] == "http.response.start":
                started = True
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = request_id
                for name, value in {**SECURITY, **secure}.items():
                    headers.setdefault(name, value)
                self._note(scope, message["status"], perf_counter() - began)
            await send(message)

        with structlog.contextvars.bound_contextvars(request_id=request_id):
            try:
                await self._app(scope, receive, sending)
            except Exception as error:
                # Here, so that this answer has its headers too, and the connection lives on.
                response = internal_error(Request(scope), error)
                if started:
                    raise
                await response(scope, receive, sending)

    def _note(self, scope: Scope, status: int, seconds: float) -> None:
        route = getattr(scope.get("route"), "path", "none")
        state: Any = getattr(scope["app"].state, "islands", None)
        if state is not None:
            method = scope["method"] if scope["method"] in METHODS else "other"
            state.metrics.latency.labels(method, route, status).observe(seconds)
        # Those who look whether we live, and how we are, would fill the log.
        if route not in ("/healthz", "/readyz", "/metrics"):
            log.info(
                "request",
                method=scope["method"],
                path=scope["path"],
                status=status,
                ms=round(1e3 * seconds, 1),
            )


class BodyLimit:
    """Refuses a body that is too large, whatever it says of its length."""

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app, self._upload = app, settings.max_upload + FORM

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        most = self._upload if scope["path"] == UPLOADS else BODY
        claimed = Headers(scope=scope).get("content-length", "0")
        error = PayloadTooLargeError(f"the request has more than {most} bytes, the most that is taken here")
        if claimed.isdecimal() and int(claimed) > most:
            return await problem_response(Request(scope), problem_of(error), error.detail)(
                scope, receive, send
            )
        received = 0

        async def receiving() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > most:
                raise error
            return message

        return await self._app(scope, receiving, send)


class SameOrigin:
    """Refuses what another site's page asks for, and names that are not ours.

    On a loopback address no key is needed, so that any page in the user's browser could ask: by a request to
    our address, or by a name of its own that it lets point to it (DNS rebinding).
    """

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app, self._names = app, None if settings.keys_needed else LOOPBACK

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] == "http" and (refusal := self._refusal(Headers(scope=scope))):
            error = CrossOriginError(refusal)
            return await problem_response(Request(scope), problem_of(error), str(error))(scope, receive, send)
        return await self._app(scope, receive, send)

    def _refusal(self, headers: Headers) -> str:
        host, origin = headers.get("host", ""), headers.get("origin")
        if origin is not None and _part(origin, "netloc") != host:
            return f"the page at {origin} may not use this service: open the service's own page"
        if self._names is not None and _part(f"//{host}", "hostname") not in self._names:
            return f"this service is not called {host}: without keys it answers to this machine's own names"
        return ""


def _part(url: str, part: str) -> str:
    """Return a part of a URL that a stranger sent; empty where it is none."""
    try:
        return getattr(urlsplit(url), part) or ""
    except ValueError:
        return ""
