"""Calls: what is sent for each thing that a client can do, and what is made of the answer. No transport."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any, Generic, TypeVar
from uuid import uuid4

import httpx

from islands_api.client.errors import ServiceError
from islands_api.schemas import (
    DatasetPage,
    DatasetView,
    HistoryPage,
    JobPage,
    JobView,
    ModelPage,
    ModelView,
    Names,
)

T = TypeVar("T")

#: A job, or its id.
JobRef = JobView | str

#: A data set, or its id.
DatasetRef = DatasetView | str

#: Answers after which the same call may succeed.
PASSING = (
    HTTPStatus.TOO_MANY_REQUESTS,
    HTTPStatus.BAD_GATEWAY,
    HTTPStatus.SERVICE_UNAVAILABLE,
    HTTPStatus.GATEWAY_TIMEOUT,
)


@dataclass(frozen=True, slots=True)
class Call(Generic[T]):
    """One request, and what its answer means.

    Attributes
    ----------
    repeatable : bool
        To send it twice does what sending it once does: it is sent again when no answer came.
    """

    method: str
    path: str
    read: Callable[[httpx.Response], T]
    params: Mapping[str, Any] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    json: Any = None
    data: Mapping[str, Any] | None = None
    file: Path | None = None
    repeatable: bool = True


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


def upload(
    path: str | Path, inputs: Sequence[str] = (), output: str | None = None, dt: float | None = None
) -> Call[DatasetView]:
    """Upload a record; with columns it is checked as a job would."""
    given: dict[str, Any] = {"inputs": list(inputs), "output": output, "dt": dt}
    form = {name: value for name, value in given.items() if value}
    return Call("POST", "/v1/datasets", _as(DatasetView), data=form, file=Path(path))


def submit(
    dataset: DatasetRef,
    inputs: Sequence[str],
    output: str,
    *,
    preset: str = "hysteresis",
    seed: int = 0,
    dt: float | None = None,
    rows: str | None = None,
    validation: float | DatasetRef | Mapping[str, Any] | None = None,
    name: str = "",
    priority: int = 0,
    idempotency_key: str | None = None,
    **settings: Any,
) -> Call[JobView]:
    """Submit a job; it has an idempotency key in any case, so that a lost answer makes no second job."""
    if isinstance(validation, str | DatasetView):
        validation = {"dataset": _id(validation)}
    given: dict[str, Any] = {
        "dataset": _id(dataset),
        "inputs": [inputs] if isinstance(inputs, str) else list(inputs),
        "output": output,
        "preset": preset,
        "seed": seed,
        "dt": dt,
        "rows": rows,
        "validation": validation,
        "name": name or None,
        "priority": priority or None,
        "settings": settings or None,
    }
    body = {key: value for key, value in given.items() if value is not None}
    key = idempotency_key or uuid4().hex
    return Call("POST", "/v1/jobs", _as(JobView), headers={"Idempotency-Key": key}, json=body)


def job(which: JobRef) -> Call[JobView]:
    """Look at a job."""
    return Call("GET", f"/v1/jobs/{_id(which)}", _as(JobView))


def changed(which: JobView, seconds: float) -> Call[JobView]:
    """Wait until a job is not as it was."""

    def read(response: httpx.Response) -> JobView:
        return which if response.status_code == HTTPStatus.NOT_MODIFIED else _as(JobView)(response)

    headers = {"If-None-Match": f'"{which.version}"'}
    return Call("GET", f"/v1/jobs/{which.id}", read, params={"wait": seconds}, headers=headers)


def jobs(state: str | None = None, cursor: str | None = None, limit: int = 50) -> Call[JobPage]:
    """List jobs."""
    given = {"state": state, "cursor": cursor, "limit": limit}
    params = {key: value for key, value in given.items() if value is not None}
    return Call("GET", "/v1/jobs", _as(JobPage), params=params)


def datasets(cursor: str | None = None, limit: int = 50) -> Call[DatasetPage]:
    """List data sets."""
    params = {"limit": limit, **({} if cursor is None else {"cursor": cursor})}
    return Call("GET", "/v1/datasets", _as(DatasetPage), params=params)


def cancel(which: JobRef) -> Call[JobView]:
    """Cancel a job."""
    return Call("POST", f"/v1/jobs/{_id(which)}/cancel", _as(JobView))


def resume(which: JobRef) -> Call[JobView]:
    """Have a job go on that failed or was cancelled."""
    return Call("POST", f"/v1/jobs/{_id(which)}/resume", _as(JobView), repeatable=False)


def delete(which: JobRef) -> Call[None]:
    """Delete a finished job."""
    return Call("DELETE", f"/v1/jobs/{_id(which)}", lambda _: None, repeatable=False)


def delete_dataset(which: DatasetRef) -> Call[None]:
    """Delete a data set."""
    return Call("DELETE", f"/v1/datasets/{_id(which)}", lambda _: None, repeatable=False)


def models(which: JobRef) -> Call[tuple[ModelView, ...]]:
    """Take the models of a job."""
    page = _as(ModelPage)
    return Call("GET", f"/v1/jobs/{_id(which)}/models", lambda response: page(response).items)


def result(which: JobRef) -> Call[dict[str, Any]]:
    """Take the whole result."""
    return Call("GET", f"/v1/jobs/{_id(which)}/result", lambda response: dict(response.json()))


def history(which: JobRef, after: int = -1) -> Call[HistoryPage]:
    """Take the course of the search."""
    return Call("GET", f"/v1/jobs/{_id(which)}/history", _as(HistoryPage), params={"after": after})


def exported(which: JobRef, rank: int = 1, form: str = "python") -> Call[str]:
    """Take a model as text of a kind."""
    path = f"/v1/jobs/{_id(which)}/models/{rank}/export"
    return Call("GET", path, lambda response: response.text, params={"format": form})


def figure(which: JobRef, name: str, rank: int | None = 1) -> Call[bytes]:
    """Take a figure of a model, or without a rank of the search, as SVG."""
    of = "" if rank is None else f"/models/{rank}"
    return Call("GET", f"/v1/jobs/{_id(which)}{of}/figures/{name}.svg", lambda response: response.content)


def figure_names(which: JobRef, rank: int | None) -> Call[tuple[str, ...]]:
    """Ask which figures there are, of a model or of the search."""
    of = "" if rank is None else f"/models/{rank}"
    names = _as(Names)
    return Call("GET", f"/v1/jobs/{_id(which)}{of}/figures", lambda response: names(response).items)


def events_path(which: JobRef) -> str:
    """Return where a job's events come from."""
    return f"/v1/jobs/{_id(which)}/events"


def event_of(lines: Sequence[str]) -> Event | None:
    """Read the lines of one server-sent event; None of a comment."""
    fields = dict(line.split(": ", 1) for line in lines if ": " in line and not line.startswith(":"))
    if "event" not in fields:
        return None
    return Event(int(fields["id"]), fields["event"], json.loads(fields["data"]))


class EventLines:
    """Gathers lines until an event is complete."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    def take(self, line: str) -> Iterator[Event]:
        """Take a line; yield the event that it completes."""
        if line:
            self._lines.append(line)
            return
        found, self._lines = event_of(self._lines), []
        if found is not None:
            yield found


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
        document = {"detail": f"HTTP {response.status_code}: {response.text[:200]}"}
    raise ServiceError(response.status_code, document)


def _as(form: type[T]) -> Callable[[httpx.Response], T]:
    return lambda response: form.model_validate_json(response.content)  # type: ignore[attr-defined]


def _id(which: JobView | DatasetView | str) -> str:
    return which if isinstance(which, str) else which.id
