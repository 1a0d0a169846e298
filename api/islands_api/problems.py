"""Problems: the one table from an error to what HTTP says of it (RFC 9457), and how it is said.

A newcomer's error is an entry here; its type is documented in docs/reference.md and never changes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from errno import EDQUOT, ENOSPC
from http import HTTPStatus
from math import ceil
from types import MappingProxyType
from typing import Any

import structlog
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.routing import Match

from islands.errors import IslandsError, ModelError, RecordError, SettingsError
from islands_service.blobs import NoSuchBlob
from islands_service.jobs import IdempotencyConflict, NoSuchJob, QuotaExceeded, WrongState
from islands_service.store.database import StoreFull, StoreUnavailable
from islands_service.store.datasets import DatasetInUse, NoSuchDataset

log = structlog.get_logger()

MEDIA_TYPE = "application/problem+json"


class NoKey(IslandsError):
    """The request has no key, or one that opens nothing."""


class ScopeMissing(IslandsError):
    """The key does not allow this."""


class TooManyRequests(IslandsError):
    """The key has asked too much in too short a time."""

    def __init__(self, message: str, seconds: float) -> None:
        super().__init__(message)
        self.seconds = seconds


class TooLarge(HTTPException):
    """The request has more bytes than this service takes.

    One of the framework's own errors: others, raised while it reads a body, become a plain 400 to it.
    """

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, message)


class Unreadable(HTTPException):
    """The body of the request cannot be read: it is damaged, or not what it says it is."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.BAD_REQUEST, message)


class WrongMedia(HTTPException):
    """The body of the request is of another type than this path takes."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, message)


class WrongMethod(HTTPException):
    """The path does not take this method; the header Allow names those that it takes."""


class CrossOrigin(IslandsError):
    """Another site's page wants something of this service."""


class NoSuchThing(IslandsError):
    """There is no such model, figure or result."""


class NotFinished(IslandsError):
    """The job has no result yet."""


@dataclass(frozen=True, slots=True)
class Problem:
    """What HTTP says of an error: the status, the type's name, and a title for people."""

    status: HTTPStatus
    type: str
    title: str


#: By class; of a class that is not listed, its nearest listed parent.
PROBLEMS: Mapping[type[Exception], Problem] = MappingProxyType(
    {
        RecordError: Problem(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-record", "The record cannot be used"),
        SettingsError: Problem(
            HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-settings", "A setting cannot be used"
        ),
        ModelError: Problem(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-model", "A model cannot be used"),
        RequestValidationError: Problem(
            HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-request", "The request is not valid"
        ),
        IdempotencyConflict: Problem(
            HTTPStatus.UNPROCESSABLE_ENTITY, "idempotency-conflict", "The idempotency key was used before"
        ),
        NoKey: Problem(HTTPStatus.UNAUTHORIZED, "no-key", "A valid key is needed"),
        ScopeMissing: Problem(HTTPStatus.FORBIDDEN, "scope-missing", "The key does not allow this"),
        CrossOrigin: Problem(HTTPStatus.FORBIDDEN, "cross-origin", "Requests of other sites are refused"),
        NoSuchJob: Problem(HTTPStatus.NOT_FOUND, "no-such-job", "There is no such job"),
        NoSuchDataset: Problem(HTTPStatus.NOT_FOUND, "no-such-dataset", "There is no such data set"),
        NoSuchThing: Problem(HTTPStatus.NOT_FOUND, "not-found", "There is no such thing"),
        Unreadable: Problem(HTTPStatus.BAD_REQUEST, "bad-request", "The request cannot be read"),
        WrongMethod: Problem(
            HTTPStatus.METHOD_NOT_ALLOWED, "method-not-allowed", "The method is not allowed here"
        ),
        WrongMedia: Problem(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unsupported-media-type", "The body has another type"
        ),
        NotFinished: Problem(HTTPStatus.CONFLICT, "not-finished", "The job has no result"),
        WrongState: Problem(HTTPStatus.CONFLICT, "wrong-state", "The job's state does not allow this"),
        DatasetInUse: Problem(HTTPStatus.CONFLICT, "dataset-in-use", "A job needs the data set"),
        TooLarge: Problem(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "too-large", "The request is too large"),
        QuotaExceeded: Problem(HTTPStatus.TOO_MANY_REQUESTS, "quota-exceeded", "The quota is used up"),
        TooManyRequests: Problem(HTTPStatus.TOO_MANY_REQUESTS, "too-many-requests", "Too many requests"),
        NoSuchBlob: Problem(HTTPStatus.INTERNAL_SERVER_ERROR, "no-such-blob", "Stored data is lost"),
        StoreUnavailable: Problem(
            HTTPStatus.SERVICE_UNAVAILABLE, "store-unavailable", "The database does not answer"
        ),
        StoreFull: Problem(HTTPStatus.INSUFFICIENT_STORAGE, "storage-full", "There is no room left"),
        IslandsError: Problem(HTTPStatus.INTERNAL_SERVER_ERROR, "failed", "The service failed"),
        Exception: Problem(HTTPStatus.INTERNAL_SERVER_ERROR, "defect", "The service met a defect"),
    }
)

#: What the framework itself raises, by status: it has no classes for it.
_FRAMEWORK = {
    PROBLEMS[kind].status: PROBLEMS[kind]
    for kind in (Unreadable, NoSuchThing, WrongMethod, WrongMedia, TooLarge)
}

#: What may be asked of a path.
METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")

#: Seconds after which to ask again, by status.
_RETRY_AFTER = {HTTPStatus.SERVICE_UNAVAILABLE: 1, HTTPStatus.INSUFFICIENT_STORAGE: 30}


class Detail(BaseModel):
    """One thing that is wrong with a request."""

    pointer: str = Field(description="Where: a JSON pointer into the body, or the name of a parameter.")
    detail: str = Field(description="What is wrong, and what would be right.")


class ProblemDocument(BaseModel):
    """What every answer that is not a success holds."""

    model_config = ConfigDict(
        json_schema_extra={
            "examples": [
                {
                    "type": "/problems/invalid-record",
                    "title": "The record cannot be used",
                    "status": 422,
                    "detail": "piezo.csv, line 8, column y_um is empty or NaN: repair it, for example by "
                    "interpolation, or select rows without it",
                    "request_id": "5f0c2a9be1d34c6f",
                }
            ]
        }
    )

    type: str = Field(description="The same for the same kind of problem, in every version.")
    title: str
    status: int
    detail: str = Field(description="What is wrong here, and what to do.")
    request_id: str | None = Field(default=None, description="Stands in the service's logs, too.")
    errors: list[Detail] | None = None


#: Joins every route's documented answers.
RESPONSES: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "A problem (RFC 9457): the detail says what to do.",
        "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/ProblemDocument"}}},
    }
}


def problem_of(error: Exception) -> Problem:
    """Return what HTTP says of an error."""
    return next(PROBLEMS[kind] for kind in type(error).__mro__ if kind in PROBLEMS)


def answer(
    request: Request,
    problem: Problem,
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


def install(app: FastAPI) -> None:
    """Have an application answer every error as a problem."""
    app.add_exception_handler(IslandsError, _deliberate)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(HTTPException, _http)


async def _deliberate(request: Request, error: Exception) -> JSONResponse:
    problem, headers = problem_of(error), {}
    if isinstance(error, TooManyRequests):
        headers["Retry-After"] = str(ceil(error.seconds))
    if isinstance(error, QuotaExceeded):
        headers["Retry-After"] = "60"
    if isinstance(error, NoKey):
        headers["WWW-Authenticate"] = 'Bearer realm="islands"'
    if problem.status >= HTTPStatus.INTERNAL_SERVER_ERROR:
        log.error("request failed", type=problem.type, reason=str(error))
    return answer(request, problem, str(error), headers=headers)


async def _invalid(request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RequestValidationError)
    errors = [{"pointer": _pointer(entry["loc"]), "detail": str(entry["msg"])} for entry in error.errors()]
    detail = "; ".join(f"{entry['pointer']}: {entry['detail']}" for entry in errors)
    return answer(request, problem_of(error), detail, errors)


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
        return await _deliberate(request, StoreFull("there is no room to receive the request: make room"))
    if status == HTTPStatus.NOT_FOUND:
        detail = f"there is nothing at {request.url.path}: /openapi.json says what there is"
    if status == HTTPStatus.METHOD_NOT_ALLOWED:
        headers["Allow"] = ", ".join(_allowed(request))
        detail = f"{request.url.path} does not take {request.method}: it takes {headers['Allow']}"
    problem = _FRAMEWORK.get(status) or Problem(
        status, status.phrase.lower().replace(" ", "-"), status.phrase
    )
    return answer(request, problem, detail, headers=headers)


def _allowed(request: Request) -> list[str]:
    """Return the methods of a path: the framework names those of the first route that it finds."""
    routes = request.app.router.routes
    return [
        method
        for method in METHODS
        if any(route.matches({**request.scope, "method": method})[0] == Match.FULL for route in routes)
    ]


def defect(request: Request, error: Exception) -> JSONResponse:
    """Say that something went wrong that nobody has thought of; what it was stands in the log alone."""
    log.error("defect", exc_info=error)
    detail = "This is a defect of the service. Please report it with the request's id."
    return answer(request, problem_of(error), detail)
