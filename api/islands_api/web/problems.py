"""Problems: the one table from an error to what HTTP says of it (RFC 9457).

A new error is an entry here; its type is documented in docs/how-to/use-the-rest-api.md and never changes.
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
from islands_service.domain.job import IdempotencyError, JobNotFoundError, JobStateError, QuotaError
from islands_service.store.blobs import BlobNotFoundError
from islands_service.store.database import CommitUnknownError, StorageFullError, StoreUnavailableError
from islands_service.store.datasets import DatasetInUseError, DatasetNotFoundError

MEDIA_TYPE = "application/problem+json"


class AuthenticationError(IslandsError):
    """The request has no key, or one that opens nothing."""


class InsufficientScopeError(IslandsError):
    """The key does not allow this."""


class RateLimitError(IslandsError):
    """The key has asked too much in too short a time."""

    def __init__(self, message: str, seconds: float) -> None:
        super().__init__(message)
        self.seconds = seconds


class PayloadTooLargeError(HTTPException):
    """The request has more bytes than this service takes.

    One of the framework's own errors: others, raised while it reads a body, become a plain 400 to it.
    """

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, message)


class MalformedBodyError(HTTPException):
    """The body of the request cannot be read: it is damaged, or not what it says it is."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.BAD_REQUEST, message)


class UnsupportedMediaTypeError(HTTPException):
    """The body of the request is of another type than this path takes."""

    def __init__(self, message: str) -> None:
        super().__init__(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, message)


class MethodNotAllowedError(HTTPException):
    """The path does not take this method; the header Allow names those that it takes."""


class CrossOriginError(IslandsError):
    """Another site's page wants something of this service."""


class ResourceNotFoundError(IslandsError):
    """There is no such model, figure or result."""


class ResultNotReadyError(IslandsError):
    """The job has no result yet."""


@dataclass(frozen=True, slots=True)
class ProblemKind:
    """What HTTP says of an error: the status, the type's name, and a title for people."""

    status: HTTPStatus
    type: str
    title: str


#: By class; of a class that is not listed, its nearest listed parent.
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
        InsufficientScopeError: ProblemKind(
            HTTPStatus.FORBIDDEN, "scope-missing", "The key does not allow this"
        ),
        CrossOriginError: ProblemKind(
            HTTPStatus.FORBIDDEN, "cross-origin", "Requests of other sites are refused"
        ),
        JobNotFoundError: ProblemKind(HTTPStatus.NOT_FOUND, "no-such-job", "There is no such job"),
        DatasetNotFoundError: ProblemKind(
            HTTPStatus.NOT_FOUND, "no-such-dataset", "There is no such data set"
        ),
        ResourceNotFoundError: ProblemKind(HTTPStatus.NOT_FOUND, "not-found", "There is no such thing"),
        MalformedBodyError: ProblemKind(HTTPStatus.BAD_REQUEST, "bad-request", "The request cannot be read"),
        MethodNotAllowedError: ProblemKind(
            HTTPStatus.METHOD_NOT_ALLOWED, "method-not-allowed", "The method is not allowed here"
        ),
        UnsupportedMediaTypeError: ProblemKind(
            HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unsupported-media-type", "The body has another type"
        ),
        ResultNotReadyError: ProblemKind(HTTPStatus.CONFLICT, "not-finished", "The job has no result"),
        JobStateError: ProblemKind(HTTPStatus.CONFLICT, "wrong-state", "The job's state does not allow this"),
        DatasetInUseError: ProblemKind(HTTPStatus.CONFLICT, "dataset-in-use", "A job needs the data set"),
        PayloadTooLargeError: ProblemKind(
            HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "too-large", "The request is too large"
        ),
        QuotaError: ProblemKind(HTTPStatus.TOO_MANY_REQUESTS, "quota-exceeded", "The quota is used up"),
        RateLimitError: ProblemKind(HTTPStatus.TOO_MANY_REQUESTS, "too-many-requests", "Too many requests"),
        BlobNotFoundError: ProblemKind(
            HTTPStatus.INTERNAL_SERVER_ERROR, "no-such-blob", "Stored data is lost"
        ),
        StoreUnavailableError: ProblemKind(
            HTTPStatus.SERVICE_UNAVAILABLE, "store-unavailable", "The database does not answer"
        ),
        CommitUnknownError: ProblemKind(
            HTTPStatus.GATEWAY_TIMEOUT, "store-in-doubt", "Nobody knows whether it was done"
        ),
        StorageFullError: ProblemKind(
            HTTPStatus.INSUFFICIENT_STORAGE, "storage-full", "There is no room left"
        ),
        IslandsError: ProblemKind(HTTPStatus.INTERNAL_SERVER_ERROR, "failed", "The service failed"),
        Exception: ProblemKind(HTTPStatus.INTERNAL_SERVER_ERROR, "defect", "The service met a defect"),
    }
)


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


def problem_of(error: Exception) -> ProblemKind:
    """Return what HTTP says of an error."""
    return next(PROBLEMS[kind] for kind in type(error).__mro__ if kind in PROBLEMS)
