"""Exception handlers: every error becomes an RFC 9457 problem document."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from errno import EDQUOT, ENOSPC
from http import HTTPStatus
from math import ceil
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic_core import ErrorDetails
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.routing import Match
from starlette.types import Scope

from islands.document_problems import explain_problem
from islands.errors import IslandsError
from islands.records.reading.options import ReadingOptions
from islands_api.bearer_token import TokenRefusedError
from islands_api.web.problems import (
    MEDIA_TYPE,
    PROBLEMS,
    AuthenticationError,
    HeadersTooLargeError,
    MalformedBodyError,
    MethodNotAllowedError,
    PayloadTooLargeError,
    ProblemKind,
    RateLimitError,
    RequestTimeoutError,
    ResourceNotFoundError,
    UnsupportedMediaTypeError,
    lookup_problem,
    problem_document,
)
from islands_service.domain.job import QuotaError
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.database import CommitUnknownError, StorageFullError, StoreError

log = structlog.get_logger()

#: Problems of errors that the framework raises, by status: it has no separate classes for them.
_FRAMEWORK_PROBLEMS = {
    PROBLEMS[kind].status: PROBLEMS[kind]
    for kind in (
        MalformedBodyError,
        ResourceNotFoundError,
        MethodNotAllowedError,
        UnsupportedMediaTypeError,
        PayloadTooLargeError,
        RequestTimeoutError,
        HeadersTooLargeError,
    )
}

#: HTTP methods, in the order of the header Allow.
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")

#: Value of the header Retry-After in seconds, by status.
_RETRY_AFTER = {HTTPStatus.SERVICE_UNAVAILABLE: 1, HTTPStatus.INSUFFICIENT_STORAGE: 30}

#: Maximum number of errors in a response: a body of one megabyte could have a hundred thousand.
_MAX_ERRORS = 20

#: Options of reading, and the form field that has them. A request about a data set has none of them.
_OF_READING = frozenset({"reading", *(option.name for option in fields(ReadingOptions))})


def problem_response(
    request: Request,
    problem: ProblemKind,
    detail: str,
    errors: Sequence[Mapping[str, str]] | None = None,
    headers: Mapping[str, str] | None = None,
) -> JSONResponse:
    """Return a problem document as a response."""
    document = problem_document(problem, detail, request.scope.get("state", {}).get("request_id"))
    if errors is not None:
        document["errors"] = errors
    headers = dict(headers or {})
    if problem.status in _RETRY_AFTER:
        headers.setdefault("Retry-After", str(_RETRY_AFTER[problem.status]))
    return JSONResponse(document, int(problem.status), headers, MEDIA_TYPE)


def install_handlers(app: FastAPI) -> None:
    """Install handlers that turn every error of an application into a problem."""
    app.add_exception_handler(IslandsError, _handle_islands_error)
    app.add_exception_handler(RequestValidationError, _handle_invalid_request)
    app.add_exception_handler(HTTPException, _handle_http_exception)


async def _handle_islands_error(request: Request, error: Exception) -> JSONResponse:
    problem, headers = lookup_problem(error), {}
    if isinstance(error, RateLimitError):
        headers["Retry-After"] = str(ceil(error.seconds))
    if isinstance(error, QuotaError):
        headers["Retry-After"] = "60"
    if isinstance(error, AuthenticationError):
        headers["WWW-Authenticate"] = 'Bearer realm="islands"'
    if isinstance(error, TokenRefusedError):
        headers["WWW-Authenticate"] = 'Bearer realm="islands", error="invalid_token"'
    if isinstance(error, StoreError):
        route = " ".join(name_route(request.scope))
        request.app.state.islands.outages[route].fail(error, route=route, type=problem.type)
    elif problem.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        log.error("request failed", type=problem.type, reason=str(error))
    return problem_response(request, problem, _public_detail(error), headers=headers)


def _public_detail(error: Exception) -> str:
    """Return the message for the client: paths and messages of the database driver go to the log only."""
    if isinstance(error, CommitUnknownError):
        return f"{error.__doc__} Check the state, or repeat the request with the same idempotency key."
    return str(error.__doc__) if isinstance(error, StoreError | BlobNotFoundError) else str(error)


async def _handle_invalid_request(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    invalid = error.errors()
    body = getattr(request.scope.get("route"), "body_field", None)
    form = None if body is None else body.field_info.annotation
    errors = [
        {"pointer": _format_pointer(entry["loc"]), "detail": _format_message(entry, form)}
        for entry in invalid[:_MAX_ERRORS]
    ]
    detail = "; ".join(f"{entry['pointer']}: {entry['detail']}" for entry in errors)
    if len(invalid) > _MAX_ERRORS:
        detail += f"; and {len(invalid) - _MAX_ERRORS} more"
    return problem_response(request, lookup_problem(error), detail, errors)


def _format_message(problem: ErrorDetails, form: Any) -> str:
    # The framework's message for a form part without a file name.
    if "Expected UploadFile" in problem["msg"]:
        return "not a file: send a file with a file name"
    kind, *place = problem["loc"]
    if problem["type"] == "extra_forbidden" and len(place) == 1 and place[0] in _OF_READING:
        return f"{problem['msg']}: the form field reading of the upload states how a data set is read"
    return explain_problem({**problem, "loc": tuple(place)} if kind == "body" else problem, form)


def _format_pointer(location: Sequence[int | str]) -> str:
    kind, *rest = location
    path = "/".join(str(part).replace("~", "~0").replace("/", "~1") for part in rest)
    return f"/{path}" if kind == "body" else path


async def _handle_http_exception(request: Request, error: Exception) -> JSONResponse:
    """Turn an error of the framework into a problem, for example an unknown path or a wrong method."""
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    detail, headers = str(error.detail), dict(error.headers or {})
    if isinstance(error.__cause__, OSError) and error.__cause__.errno in (ENOSPC, EDQUOT):
        return await _handle_islands_error(
            request, StorageFullError("there is no disk space to receive the request: free some")
        )
    if status == HTTPStatus.NOT_FOUND:
        detail = f"there is nothing at {request.url.path}: see /openapi.json for all paths"
    if status == HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = ", ".join(_allowed_methods(request))
        detail = f"{request.url.path} does not accept {request.method}: use {headers['Allow']}"
    problem = _FRAMEWORK_PROBLEMS.get(status) or ProblemKind(
        status, status.phrase.lower().replace(" ", "-"), status.phrase
    )
    return problem_response(request, problem, detail, headers=headers)


def _allowed_methods(request: Request) -> list[str]:
    """Return the methods of all routes of a path; the framework returns those of the first one only."""
    routes = request.app.router.routes
    allowed = {
        method
        for method in METHODS
        if any(route.matches({**request.scope, "method": method})[0] == Match.FULL for route in routes)
    }
    if "GET" in allowed:
        allowed.add("HEAD")
    return [method for method in METHODS if method in allowed]


def name_route(scope: Scope) -> tuple[str, str]:
    """Return the method and the route of a request, of which there is a limited number."""
    method = scope["method"] if scope["method"] in METHODS else "other"
    return method, getattr(scope.get("route"), "path", "none")


def internal_error(request: Request, error: Exception) -> JSONResponse:
    """Return a response to an unexpected error, which is described in the log only."""
    log.error("defect", exc_info=error)
    detail = "This is a defect of the service: report it with the id of the request."
    return problem_response(request, lookup_problem(error), detail)
