"""Calls of monitors, which follow a simulation from record to record."""

from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from islands.diagnosis.settings import MonitoringSettings
from islands.settings_schema import document_settings
from islands_api.client.calls import DatasetRef, JobRef, RequestSpec, as_list, get_id, make_submission
from islands_api.client.diagnosis_calls import parse_simulation
from islands_api.client.responses import read_as
from islands_api.monitor_schemas import MonitorPage, MonitorRecordPage, MonitorSummary, MonitorView
from islands_api.schemas import JobView

#: Monitor or its id.
MonitorRef = MonitorSummary | str


@document_settings(MonitoringSettings, "settings")
def create_monitor(
    diagnosis: JobRef | None = None,
    *,
    simulation: str | Mapping[str, Any] | None = None,
    input: str | None = None,  # noqa: A002 - the name in the request body
    output: str | None = None,
    channels: str | Sequence[str] = (),
    dt: float | None = None,
    name: str = "",
    priority: int = 0,
    **settings: Any,
) -> RequestSpec[MonitorView]:
    """Create a monitor of the simulation of a diagnosis, or of a given one.

    Parameters
    ----------
    diagnosis : job or its id, optional
        Discrepancy job that has succeeded. Without it, give ``simulation``, ``input`` and ``output``.
    simulation : str or mapping, optional
        As for `diagnose`. Parameters that it does not state are those of the first record.
    input, output, channels
        Columns of the records, as for `diagnose`.
    dt : float, optional
        Sampling time in seconds, if the records have no time column.
    priority : int
        Of the jobs that analyse the records.
    **settings

    Raises
    ------
    SettingsError, ModelError
        As for `diagnose`.
    """
    given = {
        "diagnosis": None if diagnosis is None else get_id(diagnosis),
        "simulation": parse_simulation(simulation) if isinstance(simulation, str) else simulation,
        "input": input,
        "output": output,
        "channels": as_list(channels) or None,
        "dt": dt,
        "name": name or None,
        "priority": priority or None,
        **settings,
    }
    body = {field: value for field, value in given.items() if value is not None}
    return RequestSpec("POST", "/v1/monitors", read_as(MonitorView), json=body, repeatable=False)


def monitors(cursor: str | None = None, limit: int = 50) -> RequestSpec[MonitorPage]:
    """Return a page of monitors, newest first, without their states."""
    params = {"limit": limit, **({} if cursor is None else {"cursor": cursor})}
    return RequestSpec("GET", "/v1/monitors", read_as(MonitorPage), params=params)


def monitor(which: MonitorRef) -> RequestSpec[MonitorView]:
    """Return a monitor with its parameters, effects and alarms."""
    return RequestSpec("GET", _path(which), read_as(MonitorView))


def monitor_records(
    which: MonitorRef, after: int = -1, limit: int = 1000, *, rejected: bool = False
) -> RequestSpec[MonitorRecordPage]:
    """Return a page of the records of a monitor after an index. After the last page an empty one follows.

    Parameters
    ----------
    rejected : bool
        Return the records that could not be analysed instead.
    """
    params = {"after": after, "limit": limit, "rejected": rejected}
    return RequestSpec("GET", f"{_path(which)}/records", read_as(MonitorRecordPage), params=params)


def monitor_state(which: MonitorRef) -> RequestSpec[str]:
    """Return ``state.json`` of a monitor, from which `islands monitor` continues with the same bits."""
    return RequestSpec("GET", f"{_path(which)}/state", lambda response: response.text)


def add_record(
    which: MonitorRef,
    dataset: DatasetRef,
    *,
    rows: str | None = None,
    name: str = "",
    time: str | None = None,
    idempotency_key: str | None = None,
) -> RequestSpec[JobView]:
    """Submit a job that analyses the next record of a monitor.

    A random idempotency key is used if none is given, so that a lost answer does not add the record twice.

    Parameters
    ----------
    rows : str, optional
        ``START:STOP``, the samples to use.
    name : str
        Name of the record; by default that of the data set.
    time : str, optional
        Time of the record, ISO 8601.

    Raises
    ------
    SettingsError
        The idempotency key is not printable ASCII.
    """
    given = {"dataset": get_id(dataset), "rows": rows, "name": name or None, "time": time or None}
    return make_submission(f"{_path(which)}/records", given, idempotency_key)


def delete_monitor(which: MonitorRef) -> RequestSpec[None]:
    """Delete a monitor; records that wait are cancelled."""
    return RequestSpec("DELETE", _path(which), lambda _: None, repeatable=False)


def _path(which: MonitorRef) -> str:
    identity = which if isinstance(which, str) else which.id
    return f"/v1/monitors/{quote(identity, safe='')}"
