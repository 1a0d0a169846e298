"""Errors of the web service, and the table that maps each error to an HTTP problem (RFC 9457).

To add an error, add an entry to `PROBLEMS`, and a row to docs/how-to/use-the-rest-api.md. Its type never
changes.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from types import MappingProxyType
from typing import Any

from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field
from starlette.exceptions import HTTPException

from islands.errors import IslandsError, ModelError, RecordError, SettingsError
from islands_api.bearer_token import IssuerUnavailableError, TokenRefusedError
from islands_service.domain.job import (
    DatasetDeletedError,
    IdempotencyError,
    JobDeletedError,
    JobNotFoundError,
    JobStateError,
    QuotaError,
)
from islands_service.domain.monitoring import MonitorNotFoundError
from islands_service.domain.webhook import WebhookNotFoundError
from islands_service.outbound import OutboundFailedError
from islands_service.store.blobs import BlobNotFoundError, DataFolderUnavailableError
from islands_service.store.buckets import ObjectStoreError
from islands_service.store.database import CommitUnknownError, StorageFullError, StoreUnavailableError
from islands_service.store.datasets import DatasetInUseError, DatasetNotFoundError, FmuNotFoundError
from islands_service.store.keys import KeyNotFoundError
from islands_service.store.owners import OwnerNotFoundError

MEDIA_TYPE = "application/problem+json"


class AuthenticationError(IslandsError):
    """The request has no key, or an invalid one."""


class InsufficientScopeError(IslandsError):
    """The key or the token does not have the scope that the request needs."""


class RateLimitError(IslandsError):
    """The client has sent too many requests in too short a time."""

    def __init__(self, message: str, seconds: float) -> None:
        super().__init__(message)
        self.seconds = seconds


class PayloadTooLargeError(HTTPException):
    """The request has more bytes than this service accepts.

    A subclass of the framework's error: the framework turns any other error raised while it reads a body into
    a plain 400.
    """

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, message)


class UploadLimitError(RateLimitError):
    """The owner, or the service, has too many uploads in progress."""


class MalformedBodyError(HTTPException):
    """The body of the request is damaged, or does not have the type that it declares."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.BAD_REQUEST, message)


class UnsupportedMediaTypeError(HTTPException):
    """The body of the request has a media type that the path does not accept."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, message)


class RequestTimeoutError(HTTPException):
    """The client has not sent the whole request in time. The connection is closed after it."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.REQUEST_TIMEOUT, message, {"Connection": "close"})


class HeadersTooLargeError(HTTPException):
    """The headers of the request have more bytes than this service accepts."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, message)


class MethodNotAllowedError(HTTPException):
    """The path does not accept the method; the header Allow lists the methods that it accepts."""


class CrossOriginError(IslandsError):
    """The request comes from a page of another site."""


class ResourceNotFoundError(IslandsError):
    """There is no such model, figure or result."""


class NotReadyError(IslandsError):
    """The service cannot accept jobs now."""


class ResultNotReadyError(IslandsError):
    """The job has no result yet."""


@dataclass(frozen=True, slots=True)
class ProblemKind:
    """HTTP status, type name and human-readable title of a kind of problem."""

    status: HTTPStatus
    type: str
    title: str


#: Problem by class of error. A class that is not listed has the problem of its nearest listed base class.
PROBLEMS: Mapping[type[Exception], ProblemKind] = MappingProxyType(
    {
        RecordError: ProblemKind(
            HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-record", "The record cannot be used"
        ),
        SettingsError: ProblemKind(
            HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-settings", "A setting cannot be used"
        ),
        ModelError: ProblemKind(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-model", "A model cannot be used"),
        RequestValidationError: ProblemKind(
            HTTPStatus.UNPROCESSABLE_ENTITY, "invalid-request", "The request is not valid"
        ),
        IdempotencyError: ProblemKind(
            HTTPStatus.UNPROCESSABLE_ENTITY, "idempotency-conflict", "The idempotency key was used before"
        ),
        AuthenticationError: ProblemKind(HTTPStatus.UNAUTHORIZED, "no-key", "A valid key is needed"),
        TokenRefusedError: ProblemKind(HTTPStatus.UNAUTHORIZED, "invalid-token", "The token is not valid"),
        InsufficientScopeError: ProblemKind(
            HTTPStatus.FORBIDDEN, "scope-missing", "The key does not allow this"
        ),
        CrossOriginError: ProblemKind(
            HTTPStatus.FORBIDDEN, "cross-origin", "Requests from other sites are rejected"
        ),
        JobNotFoundError: ProblemKind(HTTPStatus.NOT_FOUND, "no-such-job", "There is no such job"),
        DatasetNotFoundError: ProblemKind(
            HTTPStatus.NOT_FOUND, "no-such-dataset", "There is no such data set"
        ),
        FmuNotFoundError: ProblemKind(HTTPStatus.NOT_FOUND, "no-such-fmu", "There is no such FMU"),
        KeyNotFoundError: ProblemKind(HTTPStatus.NOT_FOUND, "no-such-key", "There is no such key"),
        OwnerNotFoundError: ProblemKind(HTTPStatus.NOT_FOUND, "no-such-owner", "There is no such owner"),
        WebhookNotFoundError: ProblemKind(
            HTTPStatus.NOT_FOUND, "no-such-webhook", "There is no such webhook"
        ),
        MonitorNotFoundError: ProblemKind(
            HTTPStatus.NOT_FOUND, "no-such-monitor", "There is no such monitor"
        ),
        ResourceNotFoundError: ProblemKind(HTTPStatus.NOT_FOUND, "not-found", "There is no such resource"),
        MalformedBodyError: ProblemKind(HTTPStatus.BAD_REQUEST, "bad-request", "The request cannot be read"),
        RequestTimeoutError: ProblemKind(
            HTTPStatus.REQUEST_TIMEOUT, "request-timeout", "The request was not complete in time"
        ),
        HeadersTooLargeError: ProblemKind(
            HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "headers-too-large", "The headers are too large"
        ),
        MethodNotAllowedError: ProblemKind(
            HTTPStatus.METHOD_NOT_ALLOWED, "method-not-allowed", "The method is not allowed here"
        ),
        UnsupportedMediaTypeError: ProblemKind(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unsupported-media-type", "The body has another type"
        ),
        ResultNotReadyError: ProblemKind(HTTPStatus.CONFLICT, "not-finished", "The job has no result"),
        JobStateError: ProblemKind(HTTPStatus.CONFLICT, "wrong-state", "The job's state does not allow this"),
        DatasetDeletedError: ProblemKind(
            HTTPStatus.CONFLICT, "dataset-deleted", "The job's data set was deleted"
        ),
        JobDeletedError: ProblemKind(
            HTTPStatus.GONE, "job-deleted", "The job of the idempotency key was deleted"
        ),
        DatasetInUseError: ProblemKind(HTTPStatus.CONFLICT, "dataset-in-use", "A job needs the data set"),
        PayloadTooLargeError: ProblemKind(
            HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "too-large", "The request is too large"
        ),
        UploadLimitError: ProblemKind(
            HTTPStatus.TOO_MANY_REQUESTS, "too-many-uploads", "Too many uploads in progress"
        ),
        QuotaError: ProblemKind(HTTPStatus.TOO_MANY_REQUESTS, "quota-exceeded", "The quota is used up"),
        RateLimitError: ProblemKind(HTTPStatus.TOO_MANY_REQUESTS, "too-many-requests", "Too many requests"),
        BlobNotFoundError: ProblemKind(
            HTTPStatus.INTERNAL_SERVER_ERROR, "no-such-blob", "Stored data is lost"
        ),
        StoreUnavailableError: ProblemKind(
            HTTPStatus.SERVICE_UNAVAILABLE, "store-unavailable", "The database does not answer"
        ),
        DataFolderUnavailableError: ProblemKind(
            HTTPStatus.SERVICE_UNAVAILABLE, "data-folder-unavailable", "The data folder cannot be written"
        ),
        ObjectStoreError: ProblemKind(
            HTTPStatus.SERVICE_UNAVAILABLE, "object-store-unavailable", "The object store does not answer"
        ),
        IssuerUnavailableError: ProblemKind(
            HTTPStatus.SERVICE_UNAVAILABLE, "issuer-unavailable", "The issuer of the token does not answer"
        ),
        OutboundFailedError: ProblemKind(
            HTTPStatus.UNPROCESSABLE_ENTITY, "source-failed", "The source does not deliver the record"
        ),
        NotReadyError: ProblemKind(HTTPStatus.SERVICE_UNAVAILABLE, "not-ready", "The service is not ready"),
        CommitUnknownError: ProblemKind(
            HTTPStatus.GATEWAY_TIMEOUT, "store-in-doubt", "The outcome of the write is unknown"
        ),
        StorageFullError: ProblemKind(HTTPStatus.INSUFFICIENT_STORAGE, "storage-full", "The disk is full"),
        IslandsError: ProblemKind(HTTPStatus.INTERNAL_SERVER_ERROR, "failed", "The service failed"),
        Exception: ProblemKind(HTTPStatus.INTERNAL_SERVER_ERROR, "defect", "The service has a defect"),
    }
)


class Detail(BaseModel):
    """One error in a request."""

    pointer: str = Field(description="JSON pointer into the body, or the name of a parameter.")
    detail: str = Field(description="What is wrong, and what is accepted.")


class ProblemDocument(BaseModel):
    """Body of every error response (RFC 9457)."""

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

    type: str = Field(description="Identifies the kind of problem; the same in every version.")
    title: str
    status: int
    detail: str = Field(description="What is wrong with this request, and what to do.")
    request_id: str | None = Field(default=None, description="Also in the logs of the service.")
    errors: list[Detail] | None = None


#: Documented responses of every route.
RESPONSES: dict[int | str, dict[str, Any]] = {
    "default": {
        "description": "A problem (RFC 9457): the detail says what to do.",
        "content": {MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/ProblemDocument"}}},
    }
}


def problem_document(problem: ProblemKind, detail: str, request_id: str | None) -> dict[str, Any]:
    """Return the body of an error response, with the fields of `ProblemDocument`."""
    return {
        "type": f"/problems/{problem.type}",
        "title": problem.title,
        "status": int(problem.status),
        "detail": detail,
        "request_id": request_id,
    }


def lookup_problem(error: Exception) -> ProblemKind:
    """Return the problem of an error, by the nearest listed base class."""
    return next(PROBLEMS[kind] for kind in type(error).__mro__ if kind in PROBLEMS)
