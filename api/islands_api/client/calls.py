"""Calls: what is sent for each thing that a client can do. No transport."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any, Generic, TypeVar
from urllib.parse import quote
from uuid import uuid4

import httpx

from islands.errors import SettingsError
from islands_api.client.response_parsing import document_of, read_as
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


@dataclass(frozen=True, slots=True)
class RequestSpec(Generic[T]):
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


def upload(
    path: str | Path,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
) -> RequestSpec[DatasetView]:
    """Upload a record; with columns it is checked as a job would."""
    given: dict[str, Any] = {"inputs": names_of(inputs) or None, "output": output, "dt": dt}
    form = {name: value for name, value in given.items() if value is not None}
    return RequestSpec("POST", "/v1/datasets", read_as(DatasetView), data=form, file=Path(path))


def submit(
    dataset: DatasetRef,
    inputs: str | Sequence[str],
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
) -> RequestSpec[JobView]:
    """Submit a job; it has an idempotency key in any case, so that a lost answer makes no second job.

    Parameters
    ----------
    rows : str, optional
        ``START:STOP``, the samples that estimate.
    validation : float or data set or mapping, optional
        The share of the record's end, a data set, or ``{"dataset": ID, "rows": "START:STOP"}``.
    settings
        Those that differ from the preset's: `islands.evolution.settings.Settings`.

    Raises
    ------
    SettingsError
        A number is NaN or infinite, or the idempotency key has letters that no header may have.
    """
    if isinstance(validation, str | DatasetView):
        validation = {"dataset": id_of(validation)}
    given: dict[str, Any] = {
        "dataset": id_of(dataset),
        "inputs": names_of(inputs),
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
    return submission("/v1/jobs", given, idempotency_key)


def job(which: JobRef) -> RequestSpec[JobView]:
    """Look at a job."""
    return RequestSpec("GET", f"/v1/jobs/{_part(which)}", read_as(JobView))


def changed(which: JobView, seconds: float) -> RequestSpec[JobView]:
    """Wait until a job is not as it was."""

    def read(response: httpx.Response) -> JobView:
        return which if response.status_code == HTTPStatus.NOT_MODIFIED else read_as(JobView)(response)

    headers = {"If-None-Match": f'"{which.version}"'}
    return RequestSpec("GET", f"/v1/jobs/{_part(which)}", read, params={"wait": seconds}, headers=headers)


def jobs(state: str | None = None, cursor: str | None = None, limit: int = 50) -> RequestSpec[JobPage]:
    """List jobs."""
    given = {"state": state, "cursor": cursor, "limit": limit}
    params = {key: value for key, value in given.items() if value is not None}
    return RequestSpec("GET", "/v1/jobs", read_as(JobPage), params=params)


def datasets(cursor: str | None = None, limit: int = 50) -> RequestSpec[DatasetPage]:
    """List data sets."""
    params = {"limit": limit, **({} if cursor is None else {"cursor": cursor})}
    return RequestSpec("GET", "/v1/datasets", read_as(DatasetPage), params=params)


def cancel(which: JobRef) -> RequestSpec[JobView]:
    """Cancel a job."""
    return RequestSpec("POST", f"/v1/jobs/{_part(which)}/cancel", read_as(JobView))


def resume(which: JobRef) -> RequestSpec[JobView]:
    """Have a job go on that failed or was cancelled."""
    return RequestSpec("POST", f"/v1/jobs/{_part(which)}/resume", read_as(JobView), repeatable=False)


def delete(which: JobRef) -> RequestSpec[None]:
    """Delete a finished job."""
    return RequestSpec("DELETE", f"/v1/jobs/{_part(which)}", lambda _: None, repeatable=False)


def delete_dataset(which: DatasetRef) -> RequestSpec[None]:
    """Delete a data set."""
    return RequestSpec("DELETE", f"/v1/datasets/{_part(which)}", lambda _: None, repeatable=False)


def models(which: JobRef) -> RequestSpec[tuple[ModelView, ...]]:
    """Take the models of a job."""
    page = read_as(ModelPage)
    return RequestSpec("GET", f"/v1/jobs/{_part(which)}/models", lambda response: page(response).items)


def result(which: JobRef) -> RequestSpec[dict[str, Any]]:
    """Take the whole result."""
    return RequestSpec("GET", f"/v1/jobs/{_part(which)}/result", document_of)


def report(which: JobRef) -> RequestSpec[bytes]:
    """Take the report of a job."""
    return RequestSpec("GET", f"/v1/jobs/{_part(which)}/report", lambda response: response.content)


def extended(which: JobRef) -> RequestSpec[bytes]:
    """Take the simulation with what it lacked."""
    return RequestSpec("GET", f"/v1/jobs/{_part(which)}/extended", lambda response: response.content)


def history(which: JobRef, after: int = -1) -> RequestSpec[HistoryPage]:
    """Take the course of the search."""
    return RequestSpec(
        "GET", f"/v1/jobs/{_part(which)}/history", read_as(HistoryPage), params={"after": after}
    )


def export(which: JobRef, rank: int = 1, form: str = "python") -> RequestSpec[str]:
    """Take a model as text of a kind."""
    path = f"/v1/jobs/{_part(which)}/models/{rank}/export"
    return RequestSpec("GET", path, lambda response: response.text, params={"format": form})


def figure(which: JobRef, name: str, rank: int | None = 1) -> RequestSpec[bytes]:
    """Take a figure of a model, or without a rank of the search, as SVG."""
    of = "" if rank is None else f"/models/{rank}"
    return RequestSpec(
        "GET", f"/v1/jobs/{_part(which)}{of}/figures/{_part(name)}.svg", lambda response: response.content
    )


def figure_names(which: JobRef, rank: int | None) -> RequestSpec[tuple[str, ...]]:
    """Ask which figures there are, of a model or of the search."""
    of = "" if rank is None else f"/models/{rank}"
    names = read_as(Names)
    return RequestSpec("GET", f"/v1/jobs/{_part(which)}{of}/figures", lambda response: names(response).items)


def events_path(which: JobRef) -> str:
    """Return where a job's events come from."""
    return f"/v1/jobs/{_part(which)}/events"


def id_of(which: JobView | DatasetView | str) -> str:
    """Return the id of what is given as a value or by its id."""
    return which if isinstance(which, str) else which.id


def _part(which: JobView | DatasetView | str) -> str:
    """Return a part of a path, whatever somebody takes for an id."""
    return quote(id_of(which), safe="")


def submission(path: str, given: Mapping[str, Any], idempotency_key: str | None) -> RequestSpec[JobView]:
    """Submit a job of any kind, once; what is None is left to the service.

    Raises
    ------
    SettingsError
        As of `submit`.
    """
    body = {key: value for key, value in given.items() if value is not None}
    _refuse_no_numbers(body)
    key = uuid4().hex if idempotency_key is None else idempotency_key
    if not (key.isascii() and key.isprintable()):
        raise SettingsError(f"an idempotency key is a line of ASCII, got {key!r}")
    return RequestSpec("POST", path, read_as(JobView), headers={"Idempotency-Key": key}, json=body)


def _refuse_no_numbers(body: Mapping[str, Any]) -> None:
    try:
        json.dumps(body, allow_nan=False)
    except ValueError as error:
        raise SettingsError(
            "a number of the job is NaN or infinite: leave it out, or give another"
        ) from error


def names_of(given: str | Sequence[str]) -> list[str]:
    """Return the names that are given as a list, or as one name."""
    return [given] if isinstance(given, str) else list(given)
