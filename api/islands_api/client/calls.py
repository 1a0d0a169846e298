"""Requests of the REST API: one function for each call, without transport."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from http import HTTPStatus
from pathlib import Path
from typing import Any, Generic, TypeVar
from urllib.parse import quote
from uuid import uuid4

import httpx
import numpy as np

from islands.errors import SettingsError
from islands.evolution.presets import AUTO
from islands.models.state_space import FORMS
from islands.persistence.models import NARX
from islands_api.client.responses import read_as, read_mapping
from islands_api.dataset_schemas import DatasetPage, DatasetSummary, DatasetView, FmuSummary
from islands_api.result_schemas import LinearSystemView, SearchFreeRunView
from islands_api.schemas import (
    CallerView,
    HistoryPage,
    JobPage,
    JobView,
    ModelPage,
    ModelView,
    Names,
    OwnedJobPage,
    OwnedJobView,
    PresetPage,
)
from islands_api.simulation_schemas import Scenario, ScenarioPage, SimulatedOutput
from islands_api.webhook_schemas import (
    CreatedWebhook,
    DeliveryPage,
    DeliveryView,
    WebhookPage,
    WebhookView,
)

T = TypeVar("T")

#: Job or its id.
JobRef = JobView | str

#: Data set or its id.
DatasetRef = DatasetView | DatasetSummary | str

#: Webhook or its id.
WebhookRef = WebhookView | str


@dataclass(frozen=True, slots=True)
class RequestSpec(Generic[T]):
    """Request, and the function that reads its answer.

    Attributes
    ----------
    read : callable
        Reads the answer.
    data, file : mapping and Path, optional
        Fields and file of a multipart form.
    repeatable : bool
        Whether the request is idempotent: it is sent again if no answer arrives.
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


def submit(
    dataset: DatasetRef,
    inputs: str | Sequence[str],
    output: str | Sequence[str],
    *,
    preset: str = AUTO,
    model: str = NARX,
    seed: int = 0,
    dt: float | None = None,
    rows: str | None = None,
    recordings: Sequence[DatasetRef | Mapping[str, Any]] = (),
    validation: float | DatasetRef | Mapping[str, Any] | None = None,
    name: str = "",
    tags: str | Sequence[str] = (),
    priority: int = 0,
    idempotency_key: str | None = None,
    **settings: Any,
) -> RequestSpec[JobView]:
    """Submit a job that identifies a record.

    A random idempotency key is used if none is given, so that a lost answer does not create a second job.

    Parameters
    ----------
    inputs : str or sequence of str
        Input columns.
    output : str or sequence of str
        Output column; several for a model that couples them.
    model : str
        Class of the models; others than ``narx`` are fitted without a search, with the setting
        ``refit`` only.
    dt : float, optional
        Sampling time in seconds, if the record has no time column.
    rows : str, optional
        ``START:STOP``, the samples used for estimation.
    recordings : sequence of data set or mapping
        Further recordings of the same system: data sets, or ``{"dataset": ID, "rows": "START:STOP"}``.
    validation : float or data set or mapping, optional
        Fraction of the end of every recording, a data set, or a mapping as for ``recordings``.
    tags : str or sequence of str
        Words by which `jobs` finds the job.
    settings
        Settings that differ from those of the preset: `islands.evolution.settings.Settings`.

    Raises
    ------
    SettingsError
        A number is NaN or infinite, or the idempotency key is not printable ASCII.
    """
    given: dict[str, Any] = {
        "dataset": get_id(dataset),
        "inputs": as_list(inputs),
        "output": output if isinstance(output, str) else list(output),
        "preset": preset,
        "model": None if model == NARX else model,
        "seed": seed,
        "dt": dt,
        "rows": rows,
        "recordings": [make_part(each) for each in recordings] or None,
        "validation": validation
        if isinstance(validation, float | int) or validation is None
        else make_part(validation),
        "name": name or None,
        "tags": as_list(tags) or None,
        "priority": priority or None,
        "settings": settings or None,
    }
    return make_submission("/v1/jobs", given, idempotency_key)


def job(which: JobRef) -> RequestSpec[JobView]:
    """Return a job."""
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}", read_as(JobView))


def await_change(which: JobView, seconds: float) -> RequestSpec[JobView]:
    """Return a job when it has changed, or unchanged after some seconds (long polling)."""

    def read(response: httpx.Response) -> JobView:
        return which if response.status_code == HTTPStatus.NOT_MODIFIED else read_as(JobView)(response)

    headers = {"If-None-Match": f'"{which.version}"'}
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}", read, params={"wait": seconds}, headers=headers)


def jobs(
    state: str | None = None,
    cursor: str | None = None,
    limit: int = 50,
    *,
    kind: str | None = None,
    tag: str | None = None,
    q: str | None = None,
    sort: str | None = None,
) -> RequestSpec[JobPage]:
    """Return a page of jobs, newest first.

    Parameters
    ----------
    state, kind, tag : str, optional
        Only jobs that have it.
    cursor : str, optional
        ``next`` of the previous page.
    q : str, optional
        Words that a job has in its name, tags, name of the data set, equation or verdict, in any case.
    sort : str, optional
        ``"error"`` for the jobs with a model, least error first.
    """
    filters = {"state": state, "kind": kind, "tag": tag, "q": q, "sort": sort}
    given = {**filters, "cursor": cursor, "limit": limit}
    params = {key: value for key, value in given.items() if value is not None}
    return RequestSpec("GET", "/v1/jobs", read_as(JobPage), params=params)


def datasets(cursor: str | None = None, limit: int = 50) -> RequestSpec[DatasetPage]:
    """Return a page of data sets, newest first."""
    params = {"limit": limit, **({} if cursor is None else {"cursor": cursor})}
    return RequestSpec("GET", "/v1/datasets", read_as(DatasetPage), params=params)


def label(
    which: JobRef, name: str | None = None, tags: str | Sequence[str] | None = None
) -> RequestSpec[JobView]:
    """Replace the name or the tags of a job; what is None is kept."""
    given = {"name": name, "tags": None if tags is None else as_list(tags)}
    body = {key: value for key, value in given.items() if value is not None}
    return RequestSpec("PATCH", f"/v1/jobs/{quote_id(which)}", read_as(JobView), json=body)


def cancel(which: JobRef) -> RequestSpec[JobView]:
    """Cancel a job."""
    return RequestSpec("POST", f"/v1/jobs/{quote_id(which)}/cancel", read_as(JobView))


def stop(which: JobRef) -> RequestSpec[JobView]:
    """Stop the search of a job, which then succeeds with its best models."""
    return RequestSpec("POST", f"/v1/jobs/{quote_id(which)}/stop", read_as(JobView))


def resume(which: JobRef) -> RequestSpec[JobView]:
    """Resume a job that has failed or was cancelled."""
    return RequestSpec("POST", f"/v1/jobs/{quote_id(which)}/resume", read_as(JobView), repeatable=False)


def delete(which: JobRef) -> RequestSpec[None]:
    """Delete a finished job."""
    return RequestSpec("DELETE", f"/v1/jobs/{quote_id(which)}", lambda _: None, repeatable=False)


def delete_dataset(which: DatasetRef) -> RequestSpec[None]:
    """Delete a data set that no unfinished job needs."""
    return RequestSpec("DELETE", f"/v1/datasets/{quote_id(which)}", lambda _: None, repeatable=False)


def models(which: JobRef) -> RequestSpec[tuple[ModelView, ...]]:
    """Return the models of a job, least validation error first."""
    page = read_as(ModelPage)
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}/models", lambda response: page(response).items)


def result(which: JobRef) -> RequestSpec[dict[str, Any]]:
    """Return the whole result: ``result.json``, or ``discrepancy.json`` of a discrepancy job."""
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}/result", read_mapping)


def report(which: JobRef) -> RequestSpec[bytes]:
    """Return the report of a job as one HTML file."""
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}/report", lambda response: response.content)


def comparison_report(models: Sequence[JobRef | tuple[JobRef, int]]) -> RequestSpec[bytes]:
    """Return the report of a comparison of models as one HTML file.

    Parameters
    ----------
    models : sequence
        Two to six models: jobs, of which the recommended model counts, or pairs of a job and a rank.
    """
    names = [f"{get_id(each[0])}:{each[1]}" if isinstance(each, tuple) else get_id(each) for each in models]
    return RequestSpec(
        "GET", "/v1/comparisons/report", lambda response: response.content, params={"model": names}
    )


def extended(which: JobRef) -> RequestSpec[bytes]:
    """Return the extended simulation of a discrepancy job: ``extended.json``."""
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}/extended", lambda response: response.content)


def presets() -> RequestSpec[PresetPage]:
    """Return the presets of a search with their settings, and the meaning of the settings."""
    return RequestSpec("GET", "/v1/presets", read_as(PresetPage))


def export_extended(which: JobRef, form: str = "python") -> RequestSpec[str]:
    """Return an extended simulation that is one difference equation as text: python, c, latex and so on."""
    path = f"/v1/jobs/{quote_id(which)}/extended/export"
    return RequestSpec("GET", path, lambda response: response.text, params={"format": form})


def history(which: JobRef, after: int = -1) -> RequestSpec[HistoryPage]:
    """Return a page of the search history after a generation. After the last page an empty one follows."""
    return RequestSpec(
        "GET", f"/v1/jobs/{quote_id(which)}/history", read_as(HistoryPage), params={"after": after}
    )


def export(which: JobRef, rank: int = 1, form: str = "python") -> RequestSpec[str]:
    """Return a model as text: python, c, matlab, latex, json and so on."""
    path = f"/v1/jobs/{quote_id(which)}/models/{rank}/export"
    return RequestSpec("GET", path, lambda response: response.text, params={"format": form})


def fmu(which: JobRef, rank: int = 1) -> RequestSpec[bytes]:
    """Return a model as FMU of FMI 3.0, compiled for the machine of the service."""
    return RequestSpec(
        "GET", f"/v1/jobs/{quote_id(which)}/models/{rank}/fmu", lambda response: response.content
    )


def figure(which: JobRef, name: str, rank: int | None = 1, form: str = "svg") -> RequestSpec[bytes]:
    """Return a figure of a model, or of the search if the rank is None: svg, or csv with its lines."""
    of = "" if rank is None else f"/models/{rank}"
    return RequestSpec(
        "GET",
        f"/v1/jobs/{quote_id(which)}{of}/figures/{quote_id(name)}.{quote_id(form)}",
        lambda response: response.content,
    )


def linear_system(
    which: JobRef,
    rank: int = 1,
    at: Mapping[str, float] | None = None,
    form: str = FORMS[0],
    continuous: str | None = None,
) -> RequestSpec[LinearSystemView]:
    """Return the linear system of a model about an operating point.

    Parameters
    ----------
    which : str or JobView
    rank : int
    at : mapping, optional
        Levels of inputs by column, and of the outputs if the model rests at several; by default the operating
        point of a latent model, and the middle of the ranges of the data of others.
    form : str
        ``state-space`` or ``transfer-function``.
    continuous : str, optional
        ``zoh`` or ``tustin``: the system in continuous time, as of `StateSpace.to_continuous`.
    """
    params = _write_request(at, form, continuous)
    return RequestSpec("GET", _linear_path(which, rank), read_as(LinearSystemView), params=params)


def export_linear_system(
    which: JobRef,
    rank: int = 1,
    at: Mapping[str, float] | None = None,
    form: str = FORMS[0],
    notation: str = "matlab",
    continuous: str | None = None,
) -> RequestSpec[str]:
    """Return a linear system as ``matlab``, ``json`` or ``text``; see `linear_system`."""
    params = {**_write_request(at, form, continuous), "notation": notation}
    return RequestSpec("GET", _linear_path(which, rank), lambda response: response.text, params=params)


def linear_figure(
    which: JobRef,
    name: str = "bode",
    rank: int = 1,
    at: Mapping[str, float] | None = None,
    form: str = "svg",
) -> RequestSpec[bytes]:
    """Return bode, nyquist, pole-map or unit-step of a linear system: svg, or csv with its lines."""
    path = f"{_linear_path(which, rank)}/{quote_id(name)}.{quote_id(form)}"
    return RequestSpec("GET", path, lambda response: response.content, params={"at": _write_levels(at)})


def _write_request(at: Mapping[str, float] | None, form: str, continuous: str | None) -> dict[str, Any]:
    return {"at": _write_levels(at), "form": form, **({"continuous": continuous} if continuous else {})}


def _linear_path(which: JobRef, rank: int) -> str:
    return f"/v1/jobs/{quote_id(which)}/models/{rank}/linear-system"


def _write_levels(at: Mapping[str, float] | None) -> list[str]:
    return [f"{name}={float(level)!r}" for name, level in (at or {}).items()]


def figure_names(which: JobRef, rank: int | None) -> RequestSpec[tuple[str, ...]]:
    """Return the names of the figures of a model, or of the search if the rank is None."""
    of = "" if rank is None else f"/models/{rank}"
    names = read_as(Names)
    return RequestSpec(
        "GET", f"/v1/jobs/{quote_id(which)}{of}/figures", lambda response: names(response).items
    )


def get_recommended_rank(job: JobView) -> int:
    """Return the rank of the recommended model of a job; 1 without a result."""
    return int((job.summary or {}).get("rank", 1))


def events_path(which: JobRef) -> str:
    """Return the path of the event stream of a job."""
    return f"/v1/jobs/{quote_id(which)}/events"


def get_id(which: JobView | DatasetRef | FmuSummary | WebhookView) -> str:
    """Return the id of a resource that is given as a value or as an id."""
    return which if isinstance(which, str) else which.id


def quote_id(which: JobView | DatasetRef | FmuSummary | WebhookView) -> str:
    """Return an id as one percent-encoded path segment."""
    return quote(get_id(which), safe="")


def make_submission(path: str, given: Mapping[str, Any], idempotency_key: str | None) -> RequestSpec[JobView]:
    """Return the request that submits a job of any kind. Values that are None get the service's default.

    Raises
    ------
    SettingsError
        A number is NaN or infinite, or the idempotency key is not printable ASCII.
    """
    body = {key: value for key, value in given.items() if value is not None}
    _check_finite(body)
    key = uuid4().hex if idempotency_key is None else idempotency_key
    if not (key.isascii() and key.isprintable()):
        raise SettingsError(f"an idempotency key consists of printable ASCII characters, got {key!r}")
    return RequestSpec("POST", path, read_as(JobView), headers={"Idempotency-Key": key}, json=body)


def _check_finite(body: Mapping[str, Any]) -> None:
    try:
        json.dumps(body, allow_nan=False)
    except ValueError as error:
        raise SettingsError(
            "a number of the job is NaN or infinite: omit it or give a finite number"
        ) from error


def as_list(given: str | Sequence[str]) -> list[str]:
    """Return a list of names, given as one name or as a sequence."""
    return [given] if isinstance(given, str) else list(given)


def make_part(
    given: DatasetView | DatasetSummary | str | Mapping[str, Any], rows: str | None = None
) -> Mapping[str, Any]:
    """Return a recording in the form of the body; one that is given in this form is returned unchanged.

    Parameters
    ----------
    given : data set, its id, or mapping
    rows : str, optional
        ``START:STOP``, the samples of a data set to use.
    """
    if isinstance(given, Mapping):
        return given
    part = {"dataset": given if isinstance(given, str) else given.id}
    return part if rows is None else {**part, "rows": rows}


def simulate(
    which: JobRef,
    rank: int = 1,
    inputs: Mapping[str, Sequence[float] | Mapping[str, Any]] | None = None,
    *,
    samples: int | None = None,
    initial_output: float | Mapping[str, float] | None = None,
) -> RequestSpec[SimulatedOutput]:
    """Simulate a model of a job with inputs of choice.

    Parameters
    ----------
    which : str or JobView
    rank : int
        Rank of the model.
    inputs : mapping, optional
        By column, samples at the sampling time of the model (a sequence or an array), or an excitation:
        ``{"kind": "hold", "value": 1}``; ``{"kind": "sine", "amplitude": 2, "offset": 0, "frequency": 0.5}``,
        also ``triangle`` and ``steps``; ``{"kind": "sweep", "amplitude": 2, "first": 0.1, "last": 5}``;
        ``{"kind": "record", "scale": 1.2, "offset": 0}``. Other inputs are held in the middle of their range.
    samples : int, optional
        Number of samples, at most 50 000; by default that of the given samples, or 2000.
    initial_output : float or mapping, optional
        Output before the first sample, of several outputs by column; by default the stable equilibrium at the
        first values of the inputs, or the first measured output if there is no unique one.
    """
    given: dict[str, Any] = {
        "inputs": {
            name: dict(each) if isinstance(each, Mapping) else np.asarray(each, dtype=np.float64).tolist()
            for name, each in (inputs or {}).items()
        },
        "samples": samples,
        "initial_output": initial_output,
    }
    body = {name: value for name, value in given.items() if value is not None}
    path = f"/v1/jobs/{quote_id(which)}/models/{rank}/simulate"
    return RequestSpec("POST", path, read_as(SimulatedOutput), json=body)


def simulate_datasets(
    which: JobRef,
    datasets: DatasetRef | Mapping[str, Any] | Sequence[DatasetRef | Mapping[str, Any]],
    rank: int = 1,
    *,
    start: Mapping[str, float] | None = None,
    dt: float | None = None,
) -> RequestSpec[tuple[Scenario, ...]]:
    """Simulate a model of a job on data sets, of inputs alone or with measured outputs.

    Parameters
    ----------
    which : str or JobView
    datasets : data set, mapping, or sequence of them
        Data sets, or ``{"dataset": ID, "rows": "START:STOP"}``.
    rank : int
        Rank of the model.
    start : mapping, optional
        Outputs before the first sample, or the states ``x1``, ``x2``, ... of a latent model at it; by default
        the measured outputs, and without any the rest at the first inputs.
    dt : float, optional
        Sampling time in seconds of data sets that do not state it.
    """
    listed = (
        [datasets] if isinstance(datasets, str | Mapping) or not isinstance(datasets, Sequence) else datasets
    )
    given = {"datasets": [make_part(each) for each in listed], "start": dict(start or {}), "dt": dt}
    body = {name: value for name, value in given.items() if value is not None}
    path, page = f"/v1/jobs/{quote_id(which)}/models/{rank}/scenarios", read_as(ScenarioPage)
    return RequestSpec("POST", path, lambda response: page(response).items, json=body)


def free_run(which: JobRef) -> RequestSpec[SearchFreeRunView]:
    """Return the free run of the best model so far of a running search, with the measured output."""
    return RequestSpec("GET", f"/v1/jobs/{quote_id(which)}/free-run", read_as(SearchFreeRunView))


def caller() -> RequestSpec[CallerView]:
    """Return the owner and the scopes of the key of this client."""
    return RequestSpec("GET", "/v1/caller", read_as(CallerView))


def admin_jobs(
    owner: str | None = None, state: str | None = None, cursor: str | None = None, limit: int = 50
) -> RequestSpec[OwnedJobPage]:
    """Return a page of the jobs of all owners, newest first.

    Parameters
    ----------
    owner, state : str, optional
        Only jobs of this owner, or in this state.
    """
    given = {"owner": owner, "state": state, "cursor": cursor, "limit": limit}
    params = {key: value for key, value in given.items() if value is not None}
    return RequestSpec("GET", "/v1/admin/jobs", read_as(OwnedJobPage), params=params)


def admin_cancel(which: JobRef) -> RequestSpec[OwnedJobView]:
    """Cancel a job of any owner. The audit trail of the service has the key of the administrator."""
    # A repetition after a lost answer would be refused, because the job is cancelled already.
    path = f"/v1/admin/jobs/{quote_id(which)}/cancel"
    return RequestSpec("POST", path, read_as(OwnedJobView), repeatable=False)


def create_webhook(url: str, events: Sequence[str] | None = None) -> RequestSpec[CreatedWebhook]:
    """Create a webhook and return it with its secret, which no other call returns.

    Parameters
    ----------
    url : str
        HTTPS URL that receives the events.
    events : sequence of str, optional
        Some of ``job.succeeded``, ``job.failed``, ``job.cancelled`` and ``monitor.alarm``; all by default.
    """
    asked = {"url": url, **({} if events is None else {"events": list(events)})}
    return RequestSpec("POST", "/v1/webhooks", read_as(CreatedWebhook), json=asked, repeatable=False)


def webhooks() -> RequestSpec[tuple[WebhookView, ...]]:
    """Return all webhooks, oldest first."""
    page = read_as(WebhookPage)
    return RequestSpec("GET", "/v1/webhooks", lambda response: page(response).items)


def delete_webhook(which: WebhookRef) -> RequestSpec[None]:
    """Delete a webhook and its deliveries."""
    return RequestSpec("DELETE", f"/v1/webhooks/{quote_id(which)}", lambda _: None, repeatable=False)


def deliveries(which: WebhookRef) -> RequestSpec[tuple[DeliveryView, ...]]:
    """Return the last hundred deliveries of a webhook, newest first."""
    page = read_as(DeliveryPage)
    return RequestSpec(
        "GET", f"/v1/webhooks/{quote_id(which)}/deliveries", lambda response: page(response).items
    )
