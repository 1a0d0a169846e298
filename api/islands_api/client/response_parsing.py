"""Answers: what is made of what the service sends back. No transport."""

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, TypeVar

import httpx
from pydantic import BaseModel, ValidationError

from islands_api.client.errors import ServiceError

M = TypeVar("M", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happened to a job.

    Attributes
    ----------
    number : int
        The job's version after it.
    kind : str
        queued, running, progress, cancelling, succeeded, failed, cancelled.
    """

    number: int
    kind: str
    data: Mapping[str, Any]


class EventLines:
    """Gathers what comes over the wire until an event is complete."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, piece: bytes) -> Iterator[Event]:
        """Take what has come; yield the events that it completes."""
        # A line ends where a byte says so: the text of an event may hold what Unicode takes for a line's end.
        *blocks, self._rest = (self._rest + piece).split(b"\n\n")
        for block in blocks:
            fields = dict(line.split(": ", 1) for line in block.decode().split("\n") if ": " in line)
            if "event" in fields:  # what else there is are comments
                yield Event(int(fields["id"]), fields["event"], json.loads(fields["data"]))


def refuse_problem(response: httpx.Response) -> None:
    """Raise what the service says is wrong.

    Raises
    ------
    ServiceError
    """
    if response.is_success or response.status_code == HTTPStatus.NOT_MODIFIED:
        return
    try:
        document = response.json()
    except ValueError:
        document = None
    if not isinstance(document, dict):
        elsewhere = response.headers.get("location")
        said = f"look at {elsewhere}" if elsewhere else response.text[:200]
        document = {"detail": f"HTTP {response.status_code} {response.reason_phrase}: {said}"}
    raise ServiceError(response.status_code, document)


def read_as(form: type[M]) -> Callable[[httpx.Response], M]:
    """Return what reads an answer of a form.

    Raises
    ------
    ServiceError
        An answer has another one.
    """

    def read(response: httpx.Response) -> M:
        try:
            return form.model_validate_json(response.content)
        except ValidationError as error:
            raise _foreign(response) from error

    return read


def document_of(response: httpx.Response) -> dict[str, Any]:
    """Read an answer as a mapping.

    Raises
    ------
    ServiceError
        It is none.
    """
    try:
        return dict(response.json())
    except (ValueError, TypeError) as error:
        raise _foreign(response) from error


def _foreign(response: httpx.Response) -> ServiceError:
    detail = f"what answers at {response.url} is no islands service, or one of another version"
    return ServiceError(response.status_code, {"detail": detail})
