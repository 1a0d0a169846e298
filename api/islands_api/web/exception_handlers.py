"""How a problem is said: our own errors, what the framework raises, and defects, all in the one form."""

from collections.abc import Mapping, Sequence
from errno import EDQUOT, ENOSPC
from http import HTTPStatus
from math import ceil

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.routing import Match

from islands.errors import IslandsError
from islands_api.web.problems import (
    MEDIA_TYPE,
    PROBLEMS,
    AuthenticationError,
    MalformedBodyError,
    MethodNotAllowedError,
    PayloadTooLargeError,
    ProblemKind,
    RateLimitError,
    ResourceNotFoundError,
    UnsupportedMediaTypeError,
    problem_of,
)
from islands_service.domain.job import QuotaError
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.database import CommitUnknownError, StorageFullError, StoreError

log = structlog.get_logger()

#: What the framework itself raises, by status: it has no classes for it.
_FRAMEWORK = {
    PROBLEMS[kind].status: PROBLEMS[kind]
    for kind in (
        MalformedBodyError,
        ResourceNotFoundError,
        MethodNotAllowedError,
        UnsupportedMediaTypeError,
        PayloadTooLargeError,
    )
}

#: What may be asked of a path.
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")

#: Seconds after which to ask again, by status.
_RETRY_AFTER = {HTTPStatus.SERVICE_UNAVAILABLE: 1, HTTPStatus.INSUFFICIENT_STORAGE: 30}

#: The most that is said of one request: a body of a megabyte could hold a hundred thousand errors.
_ERRORS = 20


def problem_response(
    request: Request,
    problem: ProblemKind,
    detail: str,
    errors: Sequence[Mapping[str, str]] | None = None,
    headers: Mapping[str, str] | None = None,
) -> JSONResponse:
    """Say what is wrong."""
    document = {
        "type": f"/problems/{problem.type}",
        "title": problem.title,
        "status": int(problem.status),
        "detail": detail,
        "request_id": request.scope.get("state", {}).get("request_id"),
    }
    if errors is not None:
        document["errors"] = errors
    headers = dict(headers or {})
    if problem.status in _RETRY_AFTER:
        headers.setdefault("Retry-After", str(_RETRY_AFTER[problem.status]))
    return JSONResponse(document, int(problem.status), headers, MEDIA_TYPE)


def install_handlers(app: FastAPI) -> None:
    """Have an application answer every error as a problem."""
    app.add_exception_handler(IslandsError, _deliberate)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)


async def _deliberate(request: Request, error: Exception) -> JSONResponse:
    problem, headers = problem_of(error), {}
    if isinstance(error, RateLimitError):
        headers["Retry-After"] = str(ceil(error.seconds))
    if isinstance(error, QuotaError):
        headers["Retry-After"] = "60"
    if isinstance(error, AuthenticationError):
        headers["WWW-Authenticate"] = 'Bearer realm="islands"'
    if problem.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        log.error("request failed", type=problem.type, reason=str(error))
    return problem_response(request, problem, _detail(error), headers=headers)


def _detail(error: Exception) -> str:
    """Return what a stranger is told: where data lies, what a driver says, is for the log."""
    if isinstance(error, CommitUnknownError):
        return f"{error.__doc__} Look whether it was, or ask again under the same idempotency key."
    return str(error.__doc__) if isinstance(error, StoreError | BlobNotFoundError) else str(error)


async def _invalid(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    found = error.errors()
    errors = [
        {"pointer": _pointer(entry["loc"]), "detail": _words(entry["msg"])} for entry in found[:_ERRORS]
    ]
    detail = "; ".join(f"{entry['pointer']}: {entry['detail']}" for entry in errors)
    if len(found) > _ERRORS:
        detail += f"; and {len(found) - _ERRORS} more"
    return problem_response(request, problem_of(error), detail, errors)


def _words(message: str) -> str:
    # The framework's word for a part of a form that has no file's name.
    if "Expected UploadFile" in message:
        return "it is no file: send one with its name"
    return message.removeprefix("Value error, ")


def _pointer(where: Sequence[int | str]) -> str:
    kind, *rest = where
    path = "/".join(str(part).replace("~", "~0").replace("/", "~1") for part in rest)
    return f"/{path}" if kind == "body" else path


async def _http(request: Request, error: Exception) -> JSONResponse:
    """Say as a problem what the framework itself raises: no such path, a method that is not allowed."""
    assert isinstance(error, HTTPException)
    status = HTTPStatus(error.status_code)
    detail, headers = str(error.detail), dict(error.headers or {})
    if isinstance(error.__cause__, OSError) and error.__cause__.errno in (ENOSPC, EDQUOT):
        return await _deliberate(
            request, StorageFullError("there is no room to receive the request: make room")
        )
    if status == HTTPStatus.NOT_FOUND:
        detail = f"there is nothing at {request.url.path}: /openapi.json says what there is"
    if status == HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = ", ".join(_allowed(request))
        detail = f"{request.url.path} does not take {request.method}: it takes {headers['Allow']}"
    problem = _FRAMEWORK.get(status) or ProblemKind(
        status, status.phrase.lower().replace(" ", "-"), status.phrase
    )
    return problem_response(request, problem, detail, headers=headers)


def _allowed(request: Request) -> list[str]:
    """Return the methods of a path: the framework names those of the first route that it finds."""
    routes = request.app.router.routes
    return [
        method
        for method in METHODS
        if any(route.matches({**request.scope, "method": method})[0] == Match.FULL for route in routes)
    ]


def internal_error(request: Request, error: Exception) -> JSONResponse:
    """Say that something went wrong that nobody has thought of; what it was stands in the log alone."""
    log.error("defect", exc_info=error)
    detail = "This is a defect of the service. Please report it with the request's id."
    return problem_response(request, problem_of(error), detail)
