"""Middleware: request id, logging, latency, security headers, body limit, origin check, prefix and HEAD."""

import asyncio
import re
import secrets
from collections.abc import Container
from dataclasses import dataclass
from http import HTTPStatus
from time import perf_counter
from typing import Any
from urllib.parse import urlsplit

import structlog
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from islands_api.web.auth import Principal
from islands_api.web.exception_handlers import internal_error, name_route, problem_response
from islands_api.web.problems import CrossOriginError, PayloadTooLargeError, lookup_problem
from islands_service.settings import LOOPBACK, ServiceSettings

log = structlog.get_logger()

#: Maximum size in bytes of a body that is not an upload.
MAX_BODY_BYTES = 1_000_000

#: Bytes that a form may have in addition to its file.
FORM_OVERHEAD_BYTES = 100_000

#: Headers of every response. The dashboard loads nothing from other origins, and no page may frame it.
SECURITY_HEADERS = {
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; style-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
}

#: Ids of requests that are kept: UUIDs and ids of proxies, but nothing that could forge a line of the log.
_REQUEST_ID = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}")

#: Header of responses over TLS: browsers use HTTPS for a year.
_HSTS_HEADERS = {"Strict-Transport-Security": "max-age=31536000"}


class RequestLogging:
    """Middleware that logs each request with an id, measures its latency and sets security headers.

    An id that the client sends is kept, so that a request can be traced through several services. The latency
    is the time until the response starts. The line is written when the response ends, with the bytes of both
    bodies.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        start = perf_counter()
        given = Headers(scope=scope).get("x-request-id", "")
        request_id = given if _REQUEST_ID.fullmatch(given) else secrets.token_hex(8)
        scope.setdefault("state", {})["request_id"] = request_id
        security = {**SECURITY_HEADERS, **(_HSTS_HEADERS if scope["scheme"] == "https" else {})}
        entry = _Entry()

        async def receive_and_count() -> Message:
            message = await receive()
            entry.received += len(message.get("body", b""))
            return message

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                entry.status, entry.seconds = message["status"], perf_counter() - start
                self._observe(scope, entry)
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = request_id
                for name, value in security.items():
                    headers.setdefault(name, value)
            elif message["type"] == "http.response.body":
                entry.sent += len(message.get("body", b""))
                if not message.get("more_body", False):
                    self._log(scope, entry)
            await send(message)

        with structlog.contextvars.bound_contextvars(request_id=request_id):
            try:
                await self._app(scope, receive_and_count, send_with_headers)
            except Exception as error:
                # Handled here, so that this response has the headers too, and the connection stays open.
                response = internal_error(Request(scope), error)
                if entry.status is not None:
                    raise
                await response(scope, receive, send_with_headers)
            finally:
                # A stream whose client has left does not end by itself.
                self._log(scope, entry)

    def _observe(self, scope: Scope, entry: "_Entry") -> None:
        state: Any = getattr(scope["app"].state, "islands", None)
        if state is not None:
            method, route = name_route(scope)
            state.metrics.latency.labels(method, route, entry.status).observe(entry.seconds)
            # Routes answer HEAD as GET.
            name = f"{'GET' if method == 'HEAD' else method} {route}"
            outage = state.outages.get(name)
            if outage is not None and entry.status is not None and entry.status < HTTPStatus.BAD_REQUEST:
                outage.succeed(route=name)

    def _log(self, scope: Scope, entry: "_Entry") -> None:
        # Health checks and metrics scrapes would fill the log.
        if (
            entry.status is None
            or entry.logged
            or name_route(scope)[1] in ("/healthz", "/readyz", "/metrics")
        ):
            return
        entry.logged = True
        caller: Principal | None = scope["state"].get("caller")
        log.info(
            "request",
            client=scope["client"][0] if scope["client"] else None,
            owner=None if caller is None else caller.owner,
            key=None if caller is None else caller.requester.key,
            method=scope["method"],
            path=scope["path"],
            status=entry.status,
            ms=round(1e3 * entry.seconds, 1),
            received=entry.received,
            sent=entry.sent,
        )


@dataclass(slots=True)
class _Entry:
    """State of a request: status, seconds until the response started, bytes of the bodies."""

    status: int | None = None
    seconds: float = 0.0
    received: int = 0
    sent: int = 0
    logged: bool = False


class BodyLimit:
    """Middleware that rejects bodies that are too large, with or without a Content-Length header.

    Parameters
    ----------
    app : ASGIApp
    settings : ServiceSettings
    uploads : container of str
        Paths that accept files.
    """

    def __init__(self, app: ASGIApp, settings: ServiceSettings, uploads: Container[str]) -> None:
        self._app, self._uploads = app, uploads
        self._max_upload_bytes = settings.max_upload + FORM_OVERHEAD_BYTES

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] != "http":
            return await self._app(scope, receive, send)
        path = scope["path"].removeprefix(scope.get("root_path", ""))
        max_bytes = self._max_upload_bytes if path in self._uploads else MAX_BODY_BYTES
        declared = Headers(scope=scope).get("content-length", "0")
        error = PayloadTooLargeError(f"the request has more than {max_bytes} bytes, the maximum of this path")
        if declared.isdecimal() and int(declared) > max_bytes:
            return await problem_response(Request(scope), lookup_problem(error), error.detail)(
                scope, receive, send
            )
        received = 0

        async def receive_limited() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > max_bytes:
                raise error
            return message

        return await self._app(scope, receive_limited, send)


class SameOrigin:
    """Middleware that rejects requests from pages of other sites and with foreign host names.

    A loopback address needs no key, so that any page in the user's browser could send requests: to the
    address itself, or to a host name of the attacker that resolves to it (DNS rebinding). A page of another
    site does not know the key of a service with keys. There ``Origin`` is not compared with ``Host``, which
    behind a proxy may be the name of the upstream.
    """

    def __init__(self, app: ASGIApp, settings: ServiceSettings) -> None:
        self._app, self._keys_needed = app, settings.keys_needed

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] == "http" and (refusal := self._refusal(Headers(scope=scope))):
            error = CrossOriginError(refusal)
            return await problem_response(Request(scope), lookup_problem(error), str(error))(
                scope, receive, send
            )
        return await self._app(scope, receive, send)

    def _refusal(self, headers: Headers) -> str:
        host, origin = headers.get("host", ""), headers.get("origin")
        if origin is not None and not self._is_same_origin(origin, host, headers.get("sec-fetch-site")):
            return f"the page at {origin} may not use this service: open the service's own page"
        if not self._keys_needed and _get_url_part(f"//{host}", "hostname") not in LOOPBACK:
            return (
                f"{host} is not a name of this service: without keys it accepts only loopback names; "
                "behind a proxy start it with --require-keys"
            )
        return ""

    def _is_same_origin(self, origin: str, host: str, site: str | None) -> bool:
        # Browsers send Sec-Fetch-Site to HTTPS and loopback addresses, and pages cannot set it.
        if site is not None:
            return site in ("same-origin", "none")
        return self._keys_needed or _get_url_part(origin, "netloc") == host


class RootPath:
    """Middleware that accepts the path of a request with and without the prefix of a proxy.

    Some proxies remove the prefix before they forward a request, and some do not.
    """

    def __init__(self, app: ASGIApp, root_path: str) -> None:
        self._app, self._root_path = app, root_path

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] == "http":
            scope["root_path"] = self._root_path
            if not f"{scope['path']}/".startswith(f"{self._root_path}/"):
                scope["path"] = self._root_path + scope["path"]
        return await self._app(scope, receive, send)


class HeadRequests:
    """Middleware that answers HEAD like GET, without a body. An endless response ends after its headers."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handle a request."""
        if scope["type"] != "http" or scope["method"] != "HEAD":
            return await self._app(scope, receive, send)
        answered, inner = asyncio.Event(), {**scope, "method": "GET"}

        async def send_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                scope["route"] = inner.get("route")  # for the log, which is outside
                await send(message)
                await send({"type": "http.response.body"})
                answered.set()

        async def receive_until_answered() -> Message:
            await answered.wait()
            return {"type": "http.disconnect"}

        return await self._app(inner, receive_until_answered, send_headers)


def _get_url_part(url: str, part: str) -> str:
    """Return a part of an untrusted URL. Empty if the URL is invalid."""
    try:
        return getattr(urlsplit(url), part) or ""
    except ValueError:
        return ""
