"""Calls that upload, list, describe and delete data sets and FMUs, and the simulation of an uploaded FMU."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from islands.simulators.specification.code import FmuSpec
from islands_api.client.calls import DatasetRef, RequestSpec, as_list, get_id, quote_id
from islands_api.client.responses import read_as
from islands_api.dataset_schemas import DatasetView, FmuPage, FmuSummary, FmuView, Samples

#: FMU or its id.
FmuRef = FmuSummary | str


def upload(
    path: str | Path,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
    reading: Mapping[str, Any] | None = None,
) -> RequestSpec[DatasetView]:
    """Upload a record in text, XLSX, NPZ, MAT, HDF5, Parquet or TDMS.

    Parameters
    ----------
    path : str or Path
    inputs : str or sequence of str
        Input columns. If columns are given, the service checks the record as it does for a job.
    output, dt : str, float, optional
        Output column, and sampling time in seconds if the record has no time column.
    reading : mapping, optional
        Options of `islands.read_record` for all jobs, such as ``{"header": False}``.
    """
    options = json.dumps(dict(reading)) if reading else None
    given: dict[str, Any] = {"inputs": as_list(inputs) or None, "output": output, "dt": dt}
    form = {name: value for name, value in (given | {"reading": options}).items() if value is not None}
    return RequestSpec("POST", "/v1/datasets", read_as(DatasetView), data=form, file=Path(path))


def fetch(
    url: str,
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
    reading: Mapping[str, Any] | None = None,
    name: str | None = None,
) -> RequestSpec[DatasetView]:
    """Let the service download a record, from a host or bucket that its operator has listed.

    Parameters
    ----------
    url : str
        ``https://HOST/PATH`` or ``s3://BUCKET/KEY``.
    inputs, output, dt, reading
        As for `upload`.
    name : str, optional
        File name, whose suffix selects the reader; by default the last part of the URL's path.
    """
    asked = {
        "inputs": as_list(inputs),
        "output": output,
        "dt": dt,
        "reading": dict(reading or {}),
        "name": name,
    }
    given = {field: value for field, value in asked.items() if value}
    return RequestSpec("POST", "/v1/datasets/fetch", read_as(DatasetView), json={"url": url, **given})


def read_again(
    dataset: DatasetRef,
    reading: Mapping[str, Any],
    inputs: str | Sequence[str] = (),
    output: str | None = None,
    dt: float | None = None,
) -> RequestSpec[DatasetView]:
    """Return the data set of the same bytes that are read with other options.

    Parameters
    ----------
    dataset : str or DatasetView
    reading : mapping
        All options of `islands.read_record` that are not at their defaults, such as ``{"gaps": "split"}``.
        The notes of a data set name those that help.
    inputs, output, dt
        As for `upload`.
    """
    asked = {"inputs": as_list(inputs), "output": output, "dt": dt}
    given = {field: value for field, value in asked.items() if value}
    path = f"/v1/datasets/{quote_id(dataset)}/readings"
    return RequestSpec("POST", path, read_as(DatasetView), json={"reading": dict(reading), **given})


def samples(
    dataset: DatasetRef,
    columns: str | Sequence[str],
    start: int = 0,
    stop: int | None = None,
    points: int = 2000,
) -> RequestSpec[Samples]:
    """Return the extremes of columns in equal parts of the rows, for a plot.

    Parameters
    ----------
    dataset : str or DatasetView
    columns : str or sequence of str
    start, stop : int, int or None
        First row, from 0, and the row after the last one; by default all rows.
    points : int
        Largest number of parts, at most 5000.
    """
    params = {"column": as_list(columns), "start": start, "stop": stop, "points": points}
    given = {name: value for name, value in params.items() if value is not None}
    return RequestSpec("GET", f"/v1/datasets/{quote_id(dataset)}/samples", read_as(Samples), params=given)


def upload_fmu(path: str | Path) -> RequestSpec[FmuView]:
    """Upload an FMU; its ``id`` is the ``file`` of the simulation ``{"kind": "fmu", "file": ID}``."""
    return RequestSpec("POST", "/v1/fmus", read_as(FmuView), file=Path(path))


def fmus(cursor: str | None = None, limit: int = 50) -> RequestSpec[FmuPage]:
    """Return a page of the uploaded FMUs, newest first."""
    params = {"limit": limit, **({} if cursor is None else {"cursor": cursor})}
    return RequestSpec("GET", "/v1/fmus", read_as(FmuPage), params=params)


def describe_fmu(which: FmuRef) -> RequestSpec[FmuView]:
    """Return an uploaded FMU with its inputs, outputs, parameters and values at the first sample."""
    return RequestSpec("GET", f"/v1/fmus/{quote_id(which)}", read_as(FmuView))


def delete_fmu(which: FmuRef) -> RequestSpec[None]:
    """Delete an uploaded FMU that no unfinished job needs."""
    return RequestSpec("DELETE", f"/v1/fmus/{quote_id(which)}", lambda _: None, repeatable=False)


def name_uploaded(spec: FmuSpec, uploaded: FmuRef) -> dict[str, Any]:
    """Return the simulation of an FMU in a file as that of the uploaded file."""
    return {**spec.model_dump(mode="json", exclude_unset=True), "file": get_id(uploaded)}
