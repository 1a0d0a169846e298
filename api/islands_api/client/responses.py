"""Answers of the service: documents, problems and event streams, without transport."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, TypeVar

import httpx
from pydantic import BaseModel, ValidationError

from islands.errors import IslandsError

M = TypeVar("M", bound=BaseModel)


class ServiceError(IslandsError):
    """The service answered with a problem. The message is its detail.

    Attributes
    ----------
    status : int
        HTTP status.
    type : str
        Type of the problem, ``/problems/invalid-record`` and so on: see docs/how-to/use-the-rest-api.md.
    detail : str
        What is wrong, and what to do.
    document : mapping
        The whole problem document.
    """

    def __init__(self, status: int, document: Mapping[str, Any]) -> None:
        detail = document.get("detail") or document.get("title") or f"HTTP {status}"
        super().__init__(str(detail))
        self.status, self.detail, self.document = status, str(detail), document
        self.type = str(document.get("type", "about:blank"))


class ServiceUnreachableError(IslandsError):
    """The service does not answer."""


class JobFailedError(IslandsError):
    """A job has failed or was cancelled while the caller waited for its success."""


@dataclass(frozen=True, slots=True)
class Event:
    """Event of a job.

    Attributes
    ----------
    number : int
        Version of the job after the event.
    kind : str
        queued, running, progress, cancelling, stopping, succeeded, failed or cancelled.
    """

    number: int
    kind: str
    data: Mapping[str, Any]


class EventParser:
    """Incremental parser of a stream of server-sent events."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, piece: bytes) -> Iterator[Event]:
        """Take the next bytes of the stream; yield the events that they complete."""
        # Split at the byte LF only: the text of an event may contain Unicode line separators.
        *blocks, self._rest = (self._rest + piece).split(b"\n\n")
        for block in blocks:
            fields = dict(line.split(": ", 1) for line in block.decode().split("\n") if ": " in line)
            if "event" in fields:  # other blocks are comments
                yield Event(int(fields["id"]), fields["event"], json.loads(fields["data"]))


def raise_for_problem(response: httpx.Response) -> None:
    """Raise the problem that a response reports.

    Raises
    ------
    ServiceError
        The status is neither a success nor 304.
    """
    if response.is_success or response.status_code == HTTPStatus.NOT_MODIFIED:
        return
    try:
        document = response.json()
    except ValueError:
        document = None
    if not isinstance(document, dict):
        location = response.headers.get("location")
        text = f"look at {location}" if location else response.text[:200]
        document = {"detail": f"HTTP {response.status_code} {response.reason_phrase}: {text}"}
    raise ServiceError(response.status_code, document)


def read_as(model: type[M]) -> Callable[[httpx.Response], M]:
    """Return a function that reads a response as a Pydantic model.

    The function raises `ServiceError` if the response does not match the model.
    """

    def read(response: httpx.Response) -> M:
        try:
            return model.model_validate_json(response.content)
        except ValidationError as error:
            raise _incompatible_service(response) from error

    return read


def read_mapping(response: httpx.Response) -> dict[str, Any]:
    """Read a response as a JSON object.

    Raises
    ------
    ServiceError
        The response is not a JSON object.
    """
    try:
        return dict(response.json())
    except (ValueError, TypeError) as error:
        raise _incompatible_service(response) from error


def _incompatible_service(response: httpx.Response) -> ServiceError:
    detail = f"{response.url} is not an islands service, or is one of another version"
    return ServiceError(response.status_code, {"detail": detail})
